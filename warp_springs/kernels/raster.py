"""Which surface does each sample of a picture see: spheres, cylinders and triangles by scan lines.

All coordinates are view coordinates in m: x to the right, y down, z away from the viewer. A lens
is perspective (rays from the origin through (X, Y, 1)) or parallel (rays along z from (X, Y, 0));
with k = 1 or 0 both are the ray o + t d with o = (1 - k) (X, Y, 0), d = (k X, k Y, 1), so t is the
depth z either way. A sample keeps the smallest key: the bits of the positive depth (which order
like the depth itself) above the number of the surface. The smallest key does not depend on the
order of drawing, so a picture has the same bits however the work is split.

Discriminants are written in coordinates relative to the projected centre (x', y' below), where
the large terms have cancelled on paper; single precision then resolves a sphere of 1 mm at 100 m.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

EMPTY = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
"""Key of a sample that sees no surface."""

_EDGE_OVERLAP = wp.constant(1.0e-3)  # pixels that triangles reach beyond their edges: no gaps


@wp.struct
class Lens:
    """How view coordinates become samples, for one band of rows of a picture."""

    perspective: int  # 1 perspective, 0 parallel
    focal: float  # pixels per unit of X, Y
    center_x: float  # column at X = 0 [pixels]
    center_y: float  # row at Y = 0 [pixels]
    near: float  # surfaces that reach nearer than this are left out [m]
    width: int  # columns
    first_row: int  # the band's first row
    rows: int  # rows of the band
    parts: int  # threads that share a primitive's rows


@wp.func
def column(lens: Lens, x: float):
    """Pixel column of the image coordinate X."""
    return lens.center_x + lens.focal * x


@wp.func
def row(lens: Lens, y: float):
    """Pixel row of the image coordinate Y."""
    return lens.center_y + lens.focal * y


@wp.func
def flatten(lens: Lens, p: wp.vec3):
    """Image coordinates (X, Y) of a point."""
    if lens.perspective == 1:
        return wp.vec2(p[0] / p[2], p[1] / p[2])
    return wp.vec2(p[0], p[1])


@wp.func
def extent_of_sphere(lens: Lens, c: float, z: float, radius: float):
    """Lowest and highest image coordinate of a sphere along one axis (tangents to a circle)."""
    if lens.perspective == 1:
        across = z * z - radius * radius
        half = radius * wp.sqrt(wp.max(c * c + across, 0.0)) / across
        return wp.vec2(c * z / across - half, c * z / across + half)
    return wp.vec2(c - radius, c + radius)


@wp.func
def rows_between(lens: Lens, low: float, high: float):
    """First and last row, counted in the band, with samples between two heights [pixels]."""
    first = wp.max(int(wp.floor(low)) - lens.first_row, 0)
    last = wp.min(int(wp.floor(high)) - lens.first_row, lens.rows - 1)
    return wp.vec2i(first, last)


@wp.func
def first_column(lens: Lens, x: float, offset: float):
    """First column whose sample lies at or after the pixel coordinate x."""
    return int(wp.ceil(wp.clamp(x, 0.0, float(lens.width)) - offset))


@wp.func
def last_column(lens: Lens, x: float, offset: float):
    """Last column whose sample lies at or before the pixel coordinate x."""
    return wp.min(int(wp.floor(wp.clamp(x, -1.0, float(lens.width)) - offset)), lens.width - 1)


@wp.func
def roots(a: float, half_b: float, c: float):
    """Interval where a x^2 + 2 half_b x + c >= 0 for a < 0; the first is larger if it is empty."""
    inside = half_b * half_b - a * c
    if inside < 0.0:
        return wp.vec2(1.0, -1.0)
    s = wp.sqrt(inside)
    return wp.vec2((-half_b + s) / a, (-half_b - s) / a)


@wp.func
def put(keys: wp.array(dtype=wp.uint64), sample: int, depth: float, surface: int):
    """Keep the nearest surface of a sample."""
    bits = wp.uint64(wp.cast(depth, wp.uint32))
    wp.atomic_min(keys, sample, (bits << wp.uint64(32)) | wp.uint64(surface))


@wp.kernel
def draw_spheres(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),  # of the samples in a pixel, 0 ... 1
    points: wp.array(dtype=wp.vec3),
    centers: wp.array(dtype=int),  # indices of points
    radii: wp.array(dtype=float),
    first_surface: int,
    # outputs
    keys: wp.array(dtype=wp.uint64),  # (rows, samples, width) in a row
):
    """With c the centre: D = r^2 |d|^2 - |d x (c - o)|^2, t = (d . (c - o) - sqrt D) / |d|^2."""
    i, part = wp.tid()
    c = points[centers[i]]
    radius = radii[i]
    if c[2] - radius < lens.near:
        return
    k = float(lens.perspective)
    m = wp.where(lens.perspective == 1, c[2] * c[2], 1.0)
    middle = flatten(lens, c)
    r2 = radius * radius
    quadratic = k * (r2 - c[1] * c[1]) - m

    n = offsets.shape[0]
    span = extent_of_sphere(lens, c[1], c[2], radius)
    between = rows_between(lens, row(lens, span[0]), row(lens, span[1]))
    for y in range(between[0] + part, between[1] + 1, lens.parts):
        for s in range(n):
            top = (float(lens.first_row + y) + offsets[s][1] - lens.center_y) / lens.focal
            dy = top - middle[1]
            linear = k * (r2 * middle[0] + c[0] * c[1] * dy)
            constant = r2 * (1.0 + k * (middle[0] * middle[0] + top * top)) - dy * dy * (
                m + k * c[0] * c[0]
            )
            x = roots(quadratic, linear, constant)
            low = first_column(lens, column(lens, middle[0] + x[0]), offsets[s][0])
            high = last_column(lens, column(lens, middle[0] + x[1]), offsets[s][0])
            for px in range(low, high + 1):
                left = (float(px) + offsets[s][0] - lens.center_x) / lens.focal
                dx = left - middle[0]
                d = wp.max((quadratic * dx + 2.0 * linear) * dx + constant, 0.0)
                length2 = 1.0 + k * (left * left + top * top)
                along = c[2] + k * (left * c[0] + top * c[1])
                depth = (along - wp.sqrt(d)) / length2
                put(keys, (y * n + s) * lens.width + px, depth, first_surface + i)


@wp.kernel
def draw_cylinders(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),
    points: wp.array(dtype=wp.vec3),
    ends: wp.array(dtype=wp.vec2i),  # indices of points
    radii: wp.array(dtype=float),
    first_surface: int,
    # outputs
    keys: wp.array(dtype=wp.uint64),
):
    """With a, b the ends and w the unit axis: D = r^2 |d x w|^2 - (w . d x (a - o))^2.

    The second term is linear in x', y': its coefficients are `moment`. Ends are left open; they
    lie inside the spheres of the masses.
    """
    i, part = wp.tid()
    a = points[ends[i][0]]
    b = points[ends[i][1]]
    radius = radii[i]
    length = wp.length(b - a)
    if wp.min(a[2], b[2]) - radius < lens.near or length < 1.0e-9:
        return
    w = (b - a) / length
    k = float(lens.perspective)
    r2 = radius * radius
    start = flatten(lens, a)
    moment = wp.vec2(-w[1], w[0])
    if lens.perspective == 1:
        m = wp.cross(a, w)
        moment = wp.vec2(m[0], m[1])
    axial = w[2] + k * (w[0] * start[0] + w[1] * start[1])
    behind = w[2] * a[2] + k * (w[0] * a[0] + w[1] * a[1])
    quadratic = r2 * k * (1.0 - w[0] * w[0]) - moment[0] * moment[0]

    xa = extent_of_sphere(lens, a[0], a[2], radius)
    xb = extent_of_sphere(lens, b[0], b[2], radius)
    ya = extent_of_sphere(lens, a[1], a[2], radius)
    yb = extent_of_sphere(lens, b[1], b[2], radius)
    left_end = column(lens, wp.min(xa[0], xb[0]))
    right_end = column(lens, wp.max(xa[1], xb[1]))
    upper = row(lens, wp.min(ya[0], yb[0]))
    lower = row(lens, wp.max(ya[1], yb[1]))
    between = rows_between(lens, upper, lower)

    n = offsets.shape[0]
    for y in range(between[0] + part, between[1] + 1, lens.parts):
        for s in range(n):
            top = (float(lens.first_row + y) + offsets[s][1] - lens.center_y) / lens.focal
            dy = top - start[1]
            e = axial + k * w[1] * dy
            linear = r2 * k * (start[0] - e * w[0]) - moment[0] * moment[1] * dy
            constant = (
                r2 * (1.0 + k * (top * top + start[0] * start[0]) - e * e)
                - moment[1] * moment[1] * dy * dy
            )
            x0 = left_end
            x1 = right_end
            if quadratic < 0.0:
                x = roots(quadratic, linear, constant)
                x0 = wp.max(x0, column(lens, start[0] + x[0]))
                x1 = wp.min(x1, column(lens, start[0] + x[1]))
                if x[0] > x[1]:
                    x1 = x0 - 2.0
            low = first_column(lens, x0, offsets[s][0])
            high = last_column(lens, x1, offsets[s][0])
            for px in range(low, high + 1):
                left = (float(px) + offsets[s][0] - lens.center_x) / lens.focal
                dx = left - start[0]
                d = (quadratic * dx + 2.0 * linear) * dx + constant
                wd = e + k * w[0] * dx
                across2 = 1.0 + k * (left * left + top * top) - wd * wd
                if d >= 0.0 and across2 > 1.0e-9:
                    ad = a[2] + k * (left * a[0] + top * a[1])
                    wa = behind - (1.0 - k) * (dx * w[0] + dy * w[1])
                    depth = (ad - wa * wd - wp.sqrt(d)) / across2
                    height = depth * wd - wa
                    if height >= 0.0 and height <= length:
                        put(keys, (y * n + s) * lens.width + px, depth, first_surface + i)


@wp.func
def clip(span: wp.vec2, y: float, p: wp.vec3, q: wp.vec3, turn: float):
    """Cut a span of a row to the inner side of the edge p -> q; turn is the triangle's sign."""
    rise = q[1] - p[1]
    if rise == 0.0:
        return span
    x = p[0] + (y - p[1]) * ((q[0] - p[0]) / rise)
    if rise * turn > 0.0:
        return wp.vec2(span[0], wp.min(span[1], x + _EDGE_OVERLAP))
    return wp.vec2(wp.max(span[0], x - _EDGE_OVERLAP), span[1])


@wp.func
def to_pixels(lens: Lens, p: wp.vec3):
    """Column, row and the quantity that is linear in them: 1 / depth or depth."""
    flat = flatten(lens, p)
    linear = wp.where(lens.perspective == 1, 1.0 / p[2], p[2])
    return wp.vec3(column(lens, flat[0]), row(lens, flat[1]), linear)


@wp.kernel
def draw_triangles(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),
    points: wp.array(dtype=wp.vec3),
    corners: wp.array(dtype=wp.vec3i),  # indices of points
    first_surface: int,
    # outputs
    keys: wp.array(dtype=wp.uint64),
):
    """Rows are cut by the three edges; both sides of a triangle are drawn."""
    i, part = wp.tid()
    t = corners[i]
    if wp.min(points[t[0]][2], wp.min(points[t[1]][2], points[t[2]][2])) < lens.near:
        return
    a = to_pixels(lens, points[t[0]])
    b = to_pixels(lens, points[t[1]])
    c = to_pixels(lens, points[t[2]])
    ab = b - a
    ac = c - a
    area = ab[0] * ac[1] - ab[1] * ac[0]
    if wp.abs(area) < 1.0e-6:
        return
    slope_x = (ab[2] * ac[1] - ac[2] * ab[1]) / area
    slope_y = (ac[2] * ab[0] - ab[2] * ac[0]) / area
    low_z = wp.min(a[2], wp.min(b[2], c[2]))
    high_z = wp.max(a[2], wp.max(b[2], c[2]))

    left_end = wp.min(a[0], wp.min(b[0], c[0]))
    right_end = wp.max(a[0], wp.max(b[0], c[0]))
    upper = wp.min(a[1], wp.min(b[1], c[1]))
    lower = wp.max(a[1], wp.max(b[1], c[1]))
    between = rows_between(lens, upper, lower)
    n = offsets.shape[0]
    for y in range(between[0] + part, between[1] + 1, lens.parts):
        for s in range(n):
            top = float(lens.first_row + y) + offsets[s][1]
            if top >= upper and top <= lower:
                span = wp.vec2(left_end, right_end)
                span = clip(span, top, a, b, area)
                span = clip(span, top, b, c, area)
                span = clip(span, top, c, a, area)
                low = first_column(lens, span[0], offsets[s][0])
                high = last_column(lens, span[1], offsets[s][0])
                for px in range(low, high + 1):
                    left = float(px) + offsets[s][0]
                    z = wp.clamp(
                        a[2] + slope_x * (left - a[0]) + slope_y * (top - a[1]), low_z, high_z
                    )
                    depth = wp.where(lens.perspective == 1, 1.0 / z, z)
                    put(keys, (y * n + s) * lens.width + px, depth, first_surface + i)
