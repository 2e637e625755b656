"""What colour does each pixel have: sun, sky, soft shadow, a checker floor that fades away.

Coordinates are those of `raster`; colours are linear RGB. Shadows come from a map of the depths
that the sun sees. On the floor they are soft: whatever is in the map hides the floor, so a table
of sums over the map (Crow 1984) gives the hidden share of a square of any size at once, and the
mean way from what hides it to the floor sets that size (after Fernando 2005).
"""

import warp as wp

from warp_springs.kernels.raster import EMPTY, Lens

wp.set_module_options({"enable_backward": False, "max_unroll": 0})

SAMPLES = wp.constant(4)
"""Samples in a pixel of a picture."""
COLUMNS_A_THREAD = wp.constant(16)
"""Columns of the table of sums that one thread adds up: two lines of the cache."""

_LONGEST_WAY = wp.constant(2000.0)  # in texels: the sum over 1024 x 1024 stays below 2^31
_SURFACE_BITS = wp.constant(wp.uint64(0xFFFFFFFF))
_FAR = wp.constant(1.0e30)
_FADED = wp.constant(15.0)  # there, less than half a grey level of the floor is left


@wp.struct
class Sun:
    """The light, and the map of depths that it sees."""

    direction: wp.vec3  # unit vector to the sun
    up: wp.vec3  # unit vector away from the floor
    turn: wp.mat33  # view coordinates -> the sun's view coordinates
    shift: wp.vec3
    scale: float  # texels per m
    center: float  # texel at the sun's X = Y = 0
    size: int  # texels along the edge of the map
    spread: float  # half the blur's width per length from the hiding to the hidden point
    reach: int  # half the blur's greatest width; the map's rim, left empty, is wider [texels]
    floor: wp.vec3  # depth of the floor [m]: [0] + [1] column + [2] row
    depths: wp.array(dtype=wp.uint64)  # the map: keys, row by row
    sums: wp.array2d(dtype=wp.vec2i)  # over all texels above and to the left; see sum_rows


@wp.struct
class Floor:
    """A plane with a checker, and the sky that it fades into."""

    visible: int
    height: float  # of the eye above the floor [m]
    axis_x: wp.vec3  # world x and y axes, in tiles per m
    axis_y: wp.vec3
    eye_x: float  # where the eye stands, in tiles, modulo 2
    eye_y: float
    fade_from: float  # distance where fading begins [m]
    fade_over: float  # distance over which half has faded [m]
    light: wp.vec3
    dark: wp.vec3
    sky: wp.vec3
    zenith: wp.vec3
    wet: int  # whether there is water
    depth: float  # of the water's surface below the eye [m]
    clarity: float  # way after which 1 / e of the light is left [m]
    water: wp.vec3


@wp.struct
class Surfaces:
    """Everything drawn: surfaces are numbered triangles first, then cylinders, then spheres."""

    points: wp.array(dtype=wp.vec3)
    corners: wp.array(dtype=wp.vec3i)  # of triangles, as indices of points
    ends: wp.array(dtype=wp.vec2i)  # of cylinders
    end_radii: wp.array(dtype=float)
    centers: wp.array(dtype=int)  # of spheres
    center_radii: wp.array(dtype=float)
    colors: wp.array(dtype=wp.vec3)  # of every surface


@wp.func
def depth_of(key: wp.uint64):
    """Depth in a key [m]; not a number where nothing was drawn, so that no comparison holds."""
    return wp.cast(wp.uint32(key >> wp.uint64(32)), float)


@wp.kernel
def sum_rows(
    sun: Sun,
    # outputs
    sums: wp.array2d(dtype=wp.vec2i),  # (size + 1, size + 1), its first row and column zero
):
    """Sum along each row of the map: covered texels, and how far the sun's rays go on from there.

    The ways from what covers a texel to the floor are whole texels: integers add up exactly.
    """
    y = wp.tid()
    covered = wp.int32(0)
    way = wp.int32(0)
    for x in range(sun.size):
        key = sun.depths[y * sun.size + x]
        if key != EMPTY:
            floor = sun.floor[0] + sun.floor[1] * (float(x) + 0.5) + sun.floor[2] * (float(y) + 0.5)
            gap = (floor - depth_of(key)) * sun.scale
            if gap > 0.0:
                covered += 1
                way += int(wp.min(gap, _LONGEST_WAY))
        sums[y + 1, x + 1] = wp.vec2i(covered, way)


@wp.kernel
def sum_columns(
    # outputs
    sums: wp.array2d(dtype=wp.vec2i),
):
    """Make the sums along rows sums over all that lies above and to the left."""
    first = 1 + wp.tid() * COLUMNS_A_THREAD
    last = wp.min(first + COLUMNS_A_THREAD, sums.shape[1])
    for y in range(2, sums.shape[0]):
        for x in range(first, last):
            sums[y, x] = sums[y, x] + sums[y - 1, x]


@wp.func
def covered_before(sums: wp.array2d(dtype=wp.vec2i), base: int, x: float, y: float):
    """Covered area above and to the left of a place of the map, less `base` [texels]."""
    x0 = int(x)
    y0 = int(y)
    fx = x - float(x0)
    upper = wp.lerp(float(sums[y0, x0][0] - base), float(sums[y0, x0 + 1][0] - base), fx)
    lower = wp.lerp(float(sums[y0 + 1, x0][0] - base), float(sums[y0 + 1, x0 + 1][0] - base), fx)
    return wp.lerp(upper, lower, y - float(y0))


@wp.func
def shadow_on_floor(sun: Sun, p: wp.vec3):
    """Share of the sun that is hidden from a point of the floor, 0 ... 1."""
    q = sun.turn * p + sun.shift
    x = sun.center + q[0] * sun.scale
    y = sun.center + q[1] * sun.scale
    first = float(sun.reach + 1)
    last = float(sun.size) - first
    if x < first or y < first or x >= last or y >= last:
        return 0.0
    x0 = int(x) - sun.reach
    y0 = int(y) - sun.reach
    edge = 2 * sun.reach + 1
    near = (
        sun.sums[y0 + edge, x0 + edge]
        - sun.sums[y0, x0 + edge]
        - sun.sums[y0 + edge, x0]
        + sun.sums[y0, x0]
    )
    if near[0] == 0:
        return 0.0
    if near[0] == edge * edge:
        return 1.0
    blur = wp.clamp(float(near[1]) / float(near[0]) * sun.spread, 0.75, float(sun.reach))
    base = sun.sums[int(y), int(x)][0]
    hidden = covered_before(sun.sums, base, x + blur, y + blur)
    hidden -= covered_before(sun.sums, base, x - blur, y + blur)
    hidden -= covered_before(sun.sums, base, x + blur, y - blur)
    hidden += covered_before(sun.sums, base, x - blur, y - blur)
    return hidden / (4.0 * blur * blur)


@wp.func
def hidden_at(sun: Sun, x: float, y: float, z: float):
    """Share of the four texels nearest to a place of the map that hide depth z, bilinear."""
    x0 = int(wp.floor(x - 0.5))
    y0 = int(wp.floor(y - 0.5))
    if x0 < 0 or y0 < 0 or x0 >= sun.size - 1 or y0 >= sun.size - 1:
        return 0.0
    fx = x - 0.5 - float(x0)
    fy = y - 0.5 - float(y0)
    k = y0 * sun.size + x0
    upper = wp.where(depth_of(sun.depths[k]) < z, 1.0 - fx, 0.0)
    upper += wp.where(depth_of(sun.depths[k + 1]) < z, fx, 0.0)
    lower = wp.where(depth_of(sun.depths[k + sun.size]) < z, 1.0 - fx, 0.0)
    lower += wp.where(depth_of(sun.depths[k + sun.size + 1]) < z, fx, 0.0)
    return upper * (1.0 - fy) + lower * fy


@wp.func
def shadow_on_surface(
    sun: Sun,
    p: wp.vec3,
    normal: wp.vec3,
):
    """Share of the sun that is hidden from a point of a drawn surface, 0 ... 1."""
    texel = 1.0 / sun.scale
    q = sun.turn * (p + normal * (2.0 * texel)) + sun.shift
    x = sun.center + q[0] * sun.scale
    y = sun.center + q[1] * sun.scale
    z = q[2] - texel
    hidden = hidden_at(sun, x - 1.0, y - 1.0, z)
    hidden += hidden_at(sun, x + 1.0, y - 1.0, z)
    hidden += hidden_at(sun, x - 1.0, y + 1.0, z)
    hidden += hidden_at(sun, x + 1.0, y + 1.0, z)
    return 0.25 * hidden


@wp.func
def square_wave(u: float, width: float):
    """Mean of the wave that is +1 on [0, 1) and -1 on [1, 2), over `width` around u."""
    a = 0.5 * (u - 0.5 * width)
    b = 0.5 * (u + 0.5 * width)
    ramp_a = 0.5 - wp.abs(a - wp.floor(a) - 0.5)
    ramp_b = 0.5 - wp.abs(b - wp.floor(b) - 0.5)
    return 2.0 * (ramp_b - ramp_a) / width


@wp.func
def floor_depth(floor: Floor, sun: Sun, d: wp.vec3):
    """Depth at which the ray t d meets the floor; far away where it does not."""
    fall = -wp.dot(sun.up, d)
    if floor.visible == 0 or fall * floor.height <= 1.0e-7 * wp.abs(floor.height):
        return _FAR
    return floor.height / fall


@wp.func
def fade(floor: Floor, distance: float):
    """Distance beyond where fading into the sky begins, in units of what fades one half."""
    return wp.max(distance - floor.fade_from, 0.0) / floor.fade_over


@wp.func
def through_water(floor: Floor, sun: Sun, d: wp.vec3, depth: float, color: wp.vec3):
    """Colour of what lies at a depth along the ray t d, as seen through the water's surface."""
    fall = -wp.dot(sun.up, d)
    if floor.wet == 0 or fall * depth <= floor.depth:
        return color
    length = wp.length(d)
    t = floor.depth / fall
    clear = 0.72 * wp.exp(-(depth - t) * length / floor.clarity)
    seen = wp.lerp(floor.water, color, clear)
    grazing = 1.0 - fall / length
    mirror = 0.05 + 0.6 * grazing * grazing * grazing
    away = fade(floor, t * length)
    return wp.lerp(wp.lerp(seen, floor.sky, mirror), floor.sky, away * away / (1.0 + away * away))


@wp.func
def background(lens: Lens, sun: Sun, floor: Floor, d: wp.vec3, t: float):
    """Colour of floor or sky along the ray t d; the checker is averaged over a pixel."""
    length = wp.length(d)
    rise = wp.dot(sun.up, d)
    sky = wp.lerp(floor.sky, floor.zenith, wp.clamp(1.6 * rise / length, 0.0, 1.0))
    away = fade(floor, t * length)
    if away > _FADED:
        return sky
    p = d * t
    # how the place on the floor moves from pixel to pixel: d(t d)/dX = t (e - d (up.e) / (up.d))
    step = t / lens.focal
    to_right = (wp.vec3(1.0, 0.0, 0.0) - d * (sun.up[0] / rise)) * step
    to_below = (wp.vec3(0.0, 1.0, 0.0) - d * (sun.up[1] / rise)) * step
    wide_x = wp.abs(wp.dot(floor.axis_x, to_right)) + wp.abs(wp.dot(floor.axis_x, to_below))
    wide_y = wp.abs(wp.dot(floor.axis_y, to_right)) + wp.abs(wp.dot(floor.axis_y, to_below))
    wave_x = square_wave(floor.eye_x + wp.dot(floor.axis_x, p), wp.max(wide_x, 1.0e-3))
    wave_y = square_wave(floor.eye_y + wp.dot(floor.axis_y, p), wp.max(wide_y, 1.0e-3))
    color = wp.lerp(floor.dark, floor.light, 0.5 + 0.5 * wave_x * wave_y)
    color *= 1.0 - 0.62 * shadow_on_floor(sun, p)
    return wp.lerp(color, sky, away * away / (1.0 + away * away))


@wp.func
def surface_color(
    sun: Sun,
    surfaces: Surfaces,
    d: wp.vec3,
    depth: float,
    surface: int,
):
    """Colour of a drawn surface where the ray t d meets it."""
    p = d * depth
    cylinder = surface - surfaces.corners.shape[0]
    sphere = cylinder - surfaces.ends.shape[0]
    gloss = wp.float32(0.04)
    normal = wp.vec3(0.0, 0.0, -1.0)
    if cylinder < 0:
        t = surfaces.corners[surface]
        a = surfaces.points[t[0]]
        normal = wp.cross(surfaces.points[t[1]] - a, surfaces.points[t[2]] - a)
    elif sphere < 0:
        e = surfaces.ends[cylinder]
        a = surfaces.points[e[0]]
        axis = wp.normalize(surfaces.points[e[1]] - a)
        normal = p - a - axis * wp.dot(p - a, axis)
        gloss = 0.16
    else:
        normal = p - surfaces.points[surfaces.centers[sphere]]
        gloss = 0.35
    normal = wp.normalize(normal)
    if wp.dot(normal, d) > 0.0:
        normal = -normal

    facing = wp.max(wp.dot(normal, sun.direction), 0.0)
    sunlight = wp.float32(0.0)
    if facing > 0.0:
        sunlight = 1.0 - shadow_on_surface(sun, p, normal)
    from_above = 0.5 + 0.5 * wp.dot(normal, sun.up)
    skylight = wp.lerp(wp.vec3(0.30, 0.29, 0.28), wp.vec3(0.46, 0.50, 0.56), from_above)
    light = skylight + wp.vec3(0.74, 0.71, 0.66) * (facing * sunlight)
    halfway = wp.normalize(sun.direction - wp.normalize(d))
    shine = wp.max(wp.dot(normal, halfway), 0.0)
    for _ in range(5):
        shine *= shine
    white = gloss * shine * sunlight
    return wp.cw_mul(surfaces.colors[surface], light) + wp.vec3(white, white, white)


@wp.func
def pixel_color(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),
    sun: Sun,
    floor: Floor,
    surfaces: Surfaces,
    keys: wp.array(dtype=wp.uint64),
    x: int,
    y: int,
):
    """Mean colour of a pixel; each surface that its samples see is shaded only once."""
    first = y * SAMPLES * lens.width + x
    total = wp.vec3(0.0, 0.0, 0.0)
    done = wp.int32(0)
    for s in range(SAMPLES):
        if (done >> s) & 1 == 0:
            key = keys[first + s * lens.width]
            count = wp.float32(0.0)
            for other in range(SAMPLES):
                difference = keys[first + other * lens.width] ^ key
                if difference & _SURFACE_BITS == wp.uint64(0):
                    done = done | (1 << other)
                    count += 1.0
            left = (float(x) + offsets[s][0] - lens.center_x) / lens.focal
            top = (float(lens.first_row + y) + offsets[s][1] - lens.center_y) / lens.focal
            d = wp.vec3(left, top, 1.0)
            depth = depth_of(key)
            ground = floor_depth(floor, sun, d)
            color = wp.vec3(0.0, 0.0, 0.0)
            if depth <= ground:
                surface = int(key & _SURFACE_BITS)
                color = surface_color(sun, surfaces, d, depth, surface)
            else:
                depth = ground
                color = background(lens, sun, floor, d, ground)
            total += count * through_water(floor, sun, d, depth, color)
    return total / float(SAMPLES)


@wp.kernel
def shade(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),
    sun: Sun,
    floor: Floor,
    surfaces: Surfaces,
    keys: wp.array(dtype=wp.uint64),
    encode: wp.array(dtype=wp.uint8),  # linear 0 ... 1 -> screen value
    stride: int,
    # outputs
    picture: wp.array3d(dtype=wp.uint8),
):
    """Colour every stride-th pixel of a row: on a CPU whole rows, as a thread is costly there."""
    y, start = wp.tid()
    brightest = float(encode.shape[0] - 1)
    for x in range(start, lens.width, stride):
        color = pixel_color(lens, offsets, sun, floor, surfaces, keys, x, y)
        for channel in range(3):
            value = wp.clamp(color[channel], 0.0, 1.0) * brightest
            picture[lens.first_row + y, x, channel] = encode[int(value + 0.5)]
