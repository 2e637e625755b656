"""What colour does each pixel have: sun, sky, soft shadow, a checker floor that fades away.

Coordinates are those of `raster`; colours are linear RGB. The shadow is a percentage-closer soft
shadow: the mean distance of what hides the sun near a point sets how wide the edge is blurred.
"""

import warp as wp

from warp_springs.kernels.raster import EMPTY, Lens

wp.set_module_options({"enable_backward": False})

BLOCK = wp.constant(16)
"""Texels along the edge of a block of the shadow map; no blur may reach farther than this."""

_NO_SURFACE = wp.constant(wp.uint32(0xFFFFFFFF))
_FAR = wp.constant(1.0e30)


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
    spread: float  # blur [m] per m between the hiding and the hidden surface
    reach: float  # widest blur [texels]


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


@wp.struct
class Surfaces:
    """Everything drawn: surfaces are numbered triangles first, then cylinders, then spheres."""

    points: wp.array(dtype=wp.vec3)
    corners: wp.array(dtype=wp.vec3i)
    ends: wp.array(dtype=wp.vec2i)
    centers: wp.array(dtype=int)
    colors: wp.array(dtype=wp.vec3)  # of each surface


@wp.func
def depth_of(key: wp.uint64):
    """Depth in a key [m]; not a number where nothing was drawn, so that no comparison holds."""
    return wp.cast(wp.uint32(key >> wp.uint64(32)), float)


@wp.kernel
def nearest_of_blocks(
    depths: wp.array(dtype=wp.uint64),
    size: int,
    # outputs
    nearest: wp.array2d(dtype=float),
):
    """Smallest depth in each block of the shadow map."""
    by, bx = wp.tid()
    key = EMPTY
    for y in range(by * BLOCK, (by + 1) * BLOCK):
        for x in range(bx * BLOCK, (bx + 1) * BLOCK):
            key = wp.min(key, depths[y * size + x])
    nearest[by, bx] = _FAR
    if key != EMPTY:
        nearest[by, bx] = depth_of(key)


@wp.kernel
def nearest_of_neighbours(
    nearest: wp.array2d(dtype=float),
    # outputs
    around: wp.array2d(dtype=float),
):
    """Smallest depth in each block and the eight around it."""
    by, bx = wp.tid()
    z = float(_FAR)
    for y in range(wp.max(by - 1, 0), wp.min(by + 2, nearest.shape[0])):
        for x in range(wp.max(bx - 1, 0), wp.min(bx + 2, nearest.shape[1])):
            z = wp.min(z, nearest[y, x])
    around[by, bx] = z


@wp.func
def hidden_at(sun: Sun, depths: wp.array(dtype=wp.uint64), x: float, y: float, z: float):
    """Share of the four texels around a place of the map that hide depth z, bilinear."""
    x0 = int(wp.floor(x - 0.5))
    y0 = int(wp.floor(y - 0.5))
    if x0 < 0 or y0 < 0 or x0 >= sun.size - 1 or y0 >= sun.size - 1:
        return 0.0
    fx = x - 0.5 - float(x0)
    fy = y - 0.5 - float(y0)
    k = y0 * sun.size + x0
    upper = wp.where(depth_of(depths[k]) < z, 1.0 - fx, 0.0)
    upper += wp.where(depth_of(depths[k + 1]) < z, fx, 0.0)
    lower = wp.where(depth_of(depths[k + sun.size]) < z, 1.0 - fx, 0.0)
    lower += wp.where(depth_of(depths[k + sun.size + 1]) < z, fx, 0.0)
    return upper * (1.0 - fy) + lower * fy


@wp.func
def blur_of_shadow(
    sun: Sun,
    depths: wp.array(dtype=wp.uint64),
    disc: wp.array(dtype=wp.vec2),
    x: float,
    y: float,
    z: float,
):
    """Radius in texels by which the shadow at a place is blurred; negative where none is near."""
    total = float(0.0)
    count = float(0.0)
    for i in range(0, disc.shape[0], 2):
        tx = int(x + sun.reach * disc[i][0])
        ty = int(y + sun.reach * disc[i][1])
        if tx >= 0 and ty >= 0 and tx < sun.size and ty < sun.size:
            depth = depth_of(depths[ty * sun.size + tx])
            if depth < z:
                total += depth
                count += 1.0
    if count == 0.0:
        return -1.0
    return wp.clamp((z - total / count) * sun.spread * sun.scale, 0.75, sun.reach)


@wp.func
def shadow(
    sun: Sun,
    depths: wp.array(dtype=wp.uint64),
    around: wp.array2d(dtype=float),
    disc: wp.array(dtype=wp.vec2),
    p: wp.vec3,
    normal: wp.vec3,
):
    """Share of the sun that is hidden from a point, 0 ... 1."""
    texel = 1.0 / sun.scale
    q = sun.turn * (p + normal * (1.5 * texel)) + sun.shift
    x = sun.center + q[0] * sun.scale
    y = sun.center + q[1] * sun.scale
    z = q[2] - texel
    bx = int(wp.floor(x)) / BLOCK
    by = int(wp.floor(y)) / BLOCK
    if x < 0.0 or y < 0.0 or bx >= around.shape[1] or by >= around.shape[0]:
        return 0.0
    if around[by, bx] >= z:
        return 0.0
    blur = blur_of_shadow(sun, depths, disc, x, y, z)
    if blur < 0.0:
        return 0.0
    hidden = float(0.0)
    for i in range(disc.shape[0]):
        hidden += hidden_at(sun, depths, x + blur * disc[i][0], y + blur * disc[i][1], z)
    return hidden / float(disc.shape[0])


@wp.func
def square_wave(u: float, width: float):
    """Mean of the wave that is +1 on [0, 1) and -1 on [1, 2), over `width` around u."""
    a = 0.5 * (u - 0.5 * width)
    b = 0.5 * (u + 0.5 * width)
    ramp_a = 0.5 - wp.abs(a - wp.floor(a) - 0.5)
    ramp_b = 0.5 - wp.abs(b - wp.floor(b) - 0.5)
    return 2.0 * (ramp_b - ramp_a) / width


@wp.func
def sky_color(floor: Floor, rise: float):
    """Colour of the sky where a ray climbs by `rise` per unit of length."""
    return wp.lerp(floor.sky, floor.zenith, wp.clamp(rise * 1.6, 0.0, 1.0))


@wp.func
def floor_depth(floor: Floor, sun: Sun, d: wp.vec3):
    """Depth at which the ray t d meets the floor; far away where it does not."""
    fall = -wp.dot(sun.up, d)
    if floor.visible == 0 or fall * floor.height <= 1.0e-7 * wp.abs(floor.height):
        return _FAR
    return floor.height / fall


@wp.func
def background(
    lens: Lens,
    sun: Sun,
    floor: Floor,
    depths: wp.array(dtype=wp.uint64),
    around: wp.array2d(dtype=float),
    disc: wp.array(dtype=wp.vec2),
    d: wp.vec3,
):
    """Colour of the floor or the sky along the ray t d; the checker is averaged over a pixel."""
    length = wp.length(d)
    t = floor_depth(floor, sun, d)
    sky = sky_color(floor, wp.dot(sun.up, d) / length)
    away = wp.max(t * length - floor.fade_from, 0.0) / floor.fade_over
    if away > 15.0:
        return sky
    p = d * t
    # how the place on the floor moves from pixel to pixel: d(t d)/dX = t (e - d (up.e) / (up.d))
    step = t / lens.focal
    fall = wp.dot(sun.up, d)
    to_right = (wp.vec3(1.0, 0.0, 0.0) - d * (sun.up[0] / fall)) * step
    to_below = (wp.vec3(0.0, 1.0, 0.0) - d * (sun.up[1] / fall)) * step
    wide_x = wp.abs(wp.dot(floor.axis_x, to_right)) + wp.abs(wp.dot(floor.axis_x, to_below))
    wide_y = wp.abs(wp.dot(floor.axis_y, to_right)) + wp.abs(wp.dot(floor.axis_y, to_below))
    checker = square_wave(
        floor.eye_x + wp.dot(floor.axis_x, p), wp.max(wide_x, 1.0e-3)
    ) * square_wave(floor.eye_y + wp.dot(floor.axis_y, p), wp.max(wide_y, 1.0e-3))
    color = wp.lerp(floor.dark, floor.light, 0.5 + 0.5 * checker)
    hidden = shadow(sun, depths, around, disc, p, sun.up)
    color *= 1.0 - 0.62 * hidden
    return wp.lerp(color, sky, away * away / (1.0 + away * away))


@wp.func
def surface_color(
    sun: Sun,
    surfaces: Surfaces,
    depths: wp.array(dtype=wp.uint64),
    around: wp.array2d(dtype=float),
    disc: wp.array(dtype=wp.vec2),
    d: wp.vec3,
    depth: float,
    surface: int,
):
    """Colour of a drawn surface where the ray t d meets it."""
    p = d * depth
    n_triangles = surfaces.corners.shape[0]
    n_cylinders = surfaces.ends.shape[0]
    gloss = float(0.04)
    normal = wp.vec3(0.0, 0.0, -1.0)
    if surface < n_triangles:
        t = surfaces.corners[surface]
        a = surfaces.points[t[0]]
        normal = wp.cross(surfaces.points[t[1]] - a, surfaces.points[t[2]] - a)
    elif surface < n_triangles + n_cylinders:
        e = surfaces.ends[surface - n_triangles]
        a = surfaces.points[e[0]]
        axis = wp.normalize(surfaces.points[e[1]] - a)
        normal = p - a - axis * wp.dot(p - a, axis)
        gloss = 0.16
    else:
        normal = p - surfaces.points[surfaces.centers[surface - n_triangles - n_cylinders]]
        gloss = 0.35
    normal = wp.normalize(normal)
    if wp.dot(normal, d) > 0.0:
        normal = -normal

    view = wp.normalize(d)
    facing = wp.dot(normal, sun.direction)
    sunlight = float(0.0)
    if facing > 0.0:
        sunlight = 1.0 - shadow(sun, depths, around, disc, p, normal)
    from_above = 0.5 + 0.5 * wp.dot(normal, sun.up)
    skylight = wp.lerp(wp.vec3(0.30, 0.29, 0.28), wp.vec3(0.46, 0.50, 0.56), from_above)
    light = skylight + wp.vec3(0.74, 0.71, 0.66) * (wp.max(facing, 0.0) * sunlight)
    shine = wp.max(wp.dot(normal, wp.normalize(sun.direction - view)), 0.0)
    for _ in range(5):
        shine *= shine
    white = gloss * shine * sunlight
    return wp.cw_mul(surfaces.colors[surface], light) + wp.vec3(white, white, white)


@wp.kernel
def shade(
    lens: Lens,
    offsets: wp.array(dtype=wp.vec2),
    sun: Sun,
    floor: Floor,
    surfaces: Surfaces,
    depths: wp.array(dtype=wp.uint64),
    around: wp.array2d(dtype=float),
    disc: wp.array(dtype=wp.vec2),
    keys: wp.array(dtype=wp.uint64),
    encode: wp.array(dtype=wp.uint8),  # linear 0 ... 1 -> screen value
    # outputs
    picture: wp.array3d(dtype=wp.uint8),
):
    """Colour of a pixel: each surface seen by its samples is shaded once and counts by its share."""
    y, x = wp.tid()
    n = offsets.shape[0]
    total = wp.vec3(0.0, 0.0, 0.0)
    done = int(0)
    for s in range(n):
        if (done >> s) & 1 == 0:
            left = (float(x) + offsets[s][0] - lens.center_x) / lens.focal
            top = (float(lens.first_row + y) + offsets[s][1] - lens.center_y) / lens.focal
            d = wp.vec3(left, top, 1.0)
            key = keys[(y * n + s) * lens.width + x]
            surface = wp.uint32(key & wp.uint64(0xFFFFFFFF))
            count = float(0.0)
            for other in range(s, n):
                key_of_other = keys[(y * n + other) * lens.width + x]
                if wp.uint32(key_of_other & wp.uint64(0xFFFFFFFF)) == surface:
                    done = done | (1 << other)
                    count += 1.0
            color = wp.vec3(0.0, 0.0, 0.0)
            if surface == _NO_SURFACE or depth_of(key) > floor_depth(floor, sun, d):
                color = background(lens, sun, floor, depths, around, disc, d)
            else:
                color = surface_color(
                    sun, surfaces, depths, around, disc, d, depth_of(key), int(surface)
                )
            total += color * count
    top_value = float(encode.shape[0] - 1)
    for channel in range(3):
        value = wp.clamp(total[channel] / float(n), 0.0, 1.0) * top_value
        picture[lens.first_row + y, x, channel] = encode[int(value + 0.5)]
