// Colours are linear; the last step of each fragment turns them into what a screen expects.

const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp isampler2D;
precision highp sampler2DShadow;
`;

// Positions of all robots in all frames lie in one texture; two frames are blended here.
const MASSES = `
uniform isampler2D positions;
uniform ivec2 frame;   // texel of mass 0 in the two frames
uniform float blend;
uniform vec4 place;    // middle of the robot's space [m], size of a step [m]
vec3 texelOf(int i) { int w = textureSize(positions, 0).x; return vec3(texelFetch(positions, ivec2(i % w, i / w), 0).xyz); }
vec3 mass(int i) { return place.xyz + place.w * mix(texelOf(frame.x + i), texelOf(frame.y + i), blend); }
`;

const BARS = `
layout(location = 0) in vec3 shape;   // cosine, sine, share of the length
layout(location = 1) in ivec2 ends;
layout(location = 2) in vec3 tint;
layout(location = 3) in float gone;   // the frame that first shows it broken
uniform isampler2D values;
uniform ivec2 value;   // texel of spring 0 in the two frames; below 0: colours by tint
uniform mat4 camera;
uniform float radius, levels, now;
uniform vec3 neutral, positive, negative;
out vec3 world, normal, color;
${MASSES}
float level(int i) { int w = textureSize(values, 0).x; return float(texelFetch(values, ivec2(i % w, i / w), 0).x) / levels; }
void main() {
  vec3 a = mass(ends.x), b = mass(ends.y);
  vec3 along = b - a;
  float span = length(along);
  along = span > 0.0 ? along / span : vec3(0, 0, 1);
  vec3 u = normalize(cross(along, abs(along.z) < 0.9 ? vec3(0, 0, 1) : vec3(1, 0, 0)));
  normal = u * shape.x + cross(along, u) * shape.y;
  world = mix(a, b, shape.z) + radius * normal;
  float v = value.x < 0 ? 0.0 : mix(level(value.x + gl_InstanceID), level(value.y + gl_InstanceID), blend);
  color = value.x < 0 ? tint : mix(neutral, v > 0.0 ? positive : negative, abs(v));
  gl_Position = now < gone ? camera * vec4(world, 1) : vec4(2, 2, 2, 1);
}`;

const BALLS = `
layout(location = 0) in vec3 shape;   // on the unit sphere
layout(location = 1) in vec3 tint;
uniform mat4 camera;
uniform float radius;
out vec3 world, normal, color;
${MASSES}
void main() {
  normal = shape;
  color = tint;
  world = mass(gl_InstanceID) + radius * shape;
  gl_Position = camera * vec4(world, 1);
}`;

const SKIN = `
layout(location = 0) in int corner;
uniform mat4 camera;
uniform vec3 paint;
out vec3 world, normal, color;
${MASSES}
void main() {
  normal = vec3(0);    // the fragments take that of their triangle
  color = paint;
  world = mass(corner);
  gl_Position = camera * vec4(world, 1);
}`;

// Things of the world that do not move: obstacles, and the parts of arrows.
const SOLID = `
layout(location = 0) in vec3 shape;
layout(location = 1) in vec3 direction;
uniform mat4 camera, turn;
uniform vec3 paint;
out vec3 world, normal, color;
void main() {
  world = (turn * vec4(shape, 1)).xyz;
  normal = mat3(turn) * direction;
  color = paint;
  gl_Position = camera * vec4(world, 1);
}`;

const LIGHT = `
uniform vec3 eye, sun;
uniform mat4 sunView;
uniform sampler2DShadow shadow;
uniform sampler2D depths;
uniform vec3 sunSize;   // half width of the blur a metre behind the edge, sun's view [m], longest blur
vec3 screen(vec3 c) { return mix(12.92 * c, 1.055 * pow(max(c, 0.0), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)); }
uniform vec3 horizon;
uniform vec4 floorAt;    // its height, side of a tile, where fading begins, half way of it [m]
uniform vec4 water;      // its colour; way after which 1 / e of the light is left [m]
uniform float eyeAbove;  // height of the eye above its surface [m]; below 0: no surface is seen
vec3 faded(vec3 c, float way) {
  float away = max(way - floorAt.z, 0.0) / floorAt.w;
  return mix(c, horizon, away * away / (1.0 + away * away));
}
// A colour as it is seen through the surface of water, if it lies below.
vec3 below(vec3 c, vec3 p) {
  float fall = eye.z - p.z, way = length(p - eye);
  if (eyeAbove < 0.0 || fall <= eyeAbove) return c;
  float share = eyeAbove / fall, grazing = 1.0 - fall / way;
  vec3 seen = mix(water.rgb, c, 0.72 * exp(-way * (1.0 - share) / water.w));
  return faded(mix(seen, horizon, 0.05 + 0.6 * grazing * grazing * grazing), way * share);
}
bool outside(vec3 s) { return any(lessThan(s, vec3(0.002))) || any(greaterThan(s, vec3(0.998))); }
`;

const SURFACE = `
in vec3 world, normal, color;
uniform float gloss;
out vec4 result;
${LIGHT}
float lit(vec3 p, vec3 n) {
  float texel = 1.0 / float(textureSize(depths, 0).x);
  vec3 s = (sunView * vec4(p + n * (1.6 * texel * sunSize.y), 1)).xyz;
  if (outside(s)) return 1.0;
  float sum = 0.0;
  for (int i = 0; i < 4; i++) sum += texture(shadow, s + vec3(vec2(i & 1, i >> 1) - 0.5, 0) * (1.6 * texel));
  return 0.25 * sum;
}
void main() {
  vec3 toEye = normalize(eye - world);
  vec3 n = dot(normal, normal) > 0.0 ? normalize(normal) : normalize(cross(dFdx(world), dFdy(world)));
  if (dot(n, toEye) < 0.0) n = -n;
  float facing = max(dot(n, sun), 0.0);
  float light = facing > 0.0 ? lit(world, n) : 0.0;
  vec3 sky = mix(vec3(0.30, 0.29, 0.28), vec3(0.46, 0.50, 0.56), 0.5 + 0.5 * n.z);
  float shine = pow(max(dot(n, normalize(sun + toEye)), 0.0), 48.0) * gloss * light;
  vec3 seen = color * (sky + vec3(0.74, 0.71, 0.66) * (facing * light)) + shine;
  result = vec4(screen(below(seen, world)), 1);
}`;

const NOTHING = "out vec4 result; void main() { result = vec4(1); }";

const BACKDROP_CORNERS = `
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  gl_Position = vec4(at, 0.9999999, 1);
}`;

// Floor and sky. The floor's shadow is as soft as what hides the sun is far away (after Fernando 2005).
const BACKDROP = `
in vec2 at;
uniform mat4 camera;
uniform vec3 right, up, back;   // the camera's axes, the first two as long as half the picture
uniform bool hasFloor;
uniform vec3 light, dark, zenith;
out vec4 result;
${LIGHT}
float hidden(vec3 p) {
  vec3 s = (sunView * vec4(p, 1)).xyz;
  if (outside(s)) return 0.0;
  float turn = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float sum = 0.0, count = 0.0;
  for (int i = 0; i < 12; i++) {
    float a = turn + 2.3999632 * float(i);
    float d = texture(depths, s.xy + sunSize.z * sqrt((float(i) + 0.5) / 12.0) * vec2(cos(a), sin(a))).r;
    if (d < s.z) { sum += d; count += 1.0; }
  }
  if (count == 0.0) return 0.0;
  float blur = clamp((s.z - sum / count) * sunSize.x, 1.0 / float(textureSize(depths, 0).x), sunSize.z);
  float share = 0.0;
  for (int i = 0; i < 24; i++) {
    float a = turn + 2.3999632 * float(i);
    share += texture(shadow, vec3(s.xy + blur * sqrt((float(i) + 0.5) / 24.0) * vec2(cos(a), sin(a)), s.z - 0.0005));
  }
  return 1.0 - share / 24.0;
}
float checker(vec2 q) {
  vec2 w = fwidth(q) + 1e-4;
  vec2 i = 2.0 * (abs(fract((q - 0.5 * w) / 2.0) - 0.5) - abs(fract((q + 0.5 * w) / 2.0) - 0.5)) / w;
  return 0.5 - 0.5 * i.x * i.y;
}
void main() {
  vec3 d = at.x * right + at.y * up - back;
  vec3 sky = mix(horizon, zenith, clamp(1.6 * d.z / length(d), 0.0, 1.0));
  float t = (floorAt.x - eye.z) / d.z;
  vec3 p = eye + t * d;
  vec3 tile = mix(light, dark, checker(p.xy / floorAt.y));
  gl_FragDepth = 0.9999999;
  if (!hasFloor || d.z >= -1e-6) { result = vec4(screen(d.z < -1e-6 ? below(sky, eye + 1e4 * d) : sky), 1); return; }
  tile = faded(tile * (1.0 - 0.62 * hidden(p)), t * length(d));
  result = vec4(screen(below(tile, p)), 1);
  vec4 c = camera * vec4(p, 1);
  gl_FragDepth = clamp(0.5 + 0.5 * c.z / c.w + 1e-6, 0.0, 0.9999999);
}`;
