// SPDX-License-Identifier: Apache-2.0
// The kernels of shade.py.
#pragma once
#include "objreg_ros/native/binding.hpp"

namespace objreg::shade {
constexpr float FARTHEST = 1e-3f;  // 1/m

struct Maps {  // as ShadowMaps has them
  View<const float, 4> moments;
  View<const float, 3> rotation;
  View<const float, 2> position, pinhole;
  View<const float, 1> reference;
};
struct Lights {
  View<const float, 2> lamp_position, lamp_colour;
  View<const float, 1> ambient;
};
struct Faces {  // as Surfaces has them
  View<const i32, 2> faces;
  View<const float, 2> normals, uv;
  View<const i32, 1> material;
  View<const float, 1> detail;
  View<const bool, 1> open_surface;
  View<const u8, 2> texels;
  View<const i32, 2> level_start;
  View<const i32, 1> texture_size;
  View<const float, 2> response;
};
using Plane = float[4];  // value of corner 2, then the slopes beyond it

// The share 0..1 of light k that reaches a point, by Chebyshev's bound; 1 outside the map.
inline float lit(const Maps &maps, i64 k, float px, float py, float pz, float floor) {
  const View<const float, 2> R = maps.rotation.row(k);
  const float dx = px - maps.position(k, 0), dy = py - maps.position(k, 1), dz = pz - maps.position(k, 2);
  const float z = R(2, 0) * dx + R(2, 1) * dy + R(2, 2) * dz;
  if (z < 0.05f) return 1.0f;
  const float scale = maps.pinhole(k, 0) / z;
  const float u = (R(0, 0) * dx + R(0, 1) * dy + R(0, 2) * dz) * scale + maps.pinhole(k, 1);
  const float v = (R(1, 0) * dx + R(1, 1) * dy + R(1, 2) * dz) * scale + maps.pinhole(k, 1);
  const i64 size = maps.moments.shape[1];
  if (!(u >= 0.0f && v >= 0.0f && u < size - 1 && v < size - 1)) return 1.0f;
  const i64 i = static_cast<i64>(v), j = static_cast<i64>(u);
  const float a = v - static_cast<float>(i), b = u - static_cast<float>(j);
  const float w00 = (1.0f - a) * (1.0f - b), w01 = (1.0f - a) * b, w10 = a * (1.0f - b), w11 = a * b;
  const View<const float, 3> moments = maps.moments.row(k);
  float mean = w00 * moments(i, j, 0) + w01 * moments(i, j + 1, 0);
  mean += w10 * moments(i + 1, j, 0) + w11 * moments(i + 1, j + 1, 0);
  const float excess = z - maps.reference(k) - mean - 0.006f;
  if (excess <= 0.0f) return 1.0f;
  float square = w00 * moments(i, j, 1) + w01 * moments(i, j + 1, 1);
  square += w10 * moments(i + 1, j, 1) + w11 * moments(i + 1, j + 1, 1);
  const float variance = std::max(square - mean * mean, floor);
  const float share = variance / (variance + excess * excess);
  return std::max(0.0f, (share - 0.15f) * static_cast<float>(1.0 / 0.85));  // less light bleeding
}

// Column c of the corners' values of face f as `value` takes it.
inline void load(View<const float, 2> values, View<const i32, 2> faces, View<const float, 3> edges, i64 f, i64 c,
                 Plane &plane) {
  const float last = values(faces(f, 2), c);
  const float first = values(faces(f, 0), c) - last, second = values(faces(f, 1), c) - last;
  plane[0] = last;
  for (int k = 0; k < 3; k++) plane[1 + k] = first * edges(f, 0, k) + second * edges(f, 1, k);
}

// A value at depth z, (ox, oy) pixels from the first of the face's bounds: barycentric blending in one product.
inline float value(const Plane &plane, float ox, float oy, float z) {
  return plane[0] + (plane[1] + plane[2] * ox + plane[3] * oy) * z;
}

struct Level {
  i64 number, size;
};

// The mip level whose texels are about as large as a pixel of `pixel` textures, and the level's size.
inline Level mip_level(i64 size, i64 levels, float pixel, float cosine) {
  float spread = pixel * static_cast<float>(size);
  spread *= spread / std::max(cosine, 0.1f);
  i64 level = 0;
  while (spread > 2.0f && level < levels - 1 && size > 1) spread *= 0.25f, size >>= 1, level++;
  return {level, size};
}

// Bilinear, repeating texture lookup of one mip level, squared to linear light.
inline void texel(View<const u8, 2> texels, i64 start, i64 size, float u, float v, float (&out)[3]) {
  const i64 mask = size - 1;
  const float x = u * static_cast<float>(size) - 0.5f, y = v * static_cast<float>(size) - 0.5f;
  const float fx = std::floor(x), fy = std::floor(y);
  const float a = x - fx, b = y - fy;
  const i64 i = static_cast<i64>(fy), j = static_cast<i64>(fx);
  const i64 above = start + (i & mask) * size, below = start + ((i + 1) & mask) * size;
  const i64 left = j & mask, right = (j + 1) & mask;
  const View<const u8, 1> p00 = texels.row(above + left), p01 = texels.row(above + right);
  const View<const u8, 1> p10 = texels.row(below + left), p11 = texels.row(below + right);
  const float w00 = (1.0f - a) * (1.0f - b), w01 = a * (1.0f - b), w10 = (1.0f - a) * b, w11 = a * b;
  for (int c = 0; c < 3; c++) {
    float level = w00 * static_cast<float>(p00(c)) + w01 * static_cast<float>(p01(c));
    level += w10 * static_cast<float>(p10(c)) + w11 * static_cast<float>(p11(c));
    level *= static_cast<float>(1.0 / 255.0);
    out[c] = level * level;
  }
}

struct Light {  // of a pixel: diffuse light, highlight, and the mip level
  float diffuse[3], highlight[3];
  Level level;
};

// Light on a point with normal n seen along v.
inline void illuminate(float px, float py, float pz, float nx, float ny, float nz, float vx, float vy, float vz,
                       float specular, int gloss, const Lights &lights, const Maps &maps, Light &light) {
  const float opening = lit(maps, 0, px, py, pz, 2e-3f);
  const float up = (0.75f + 0.25f * nz) * (0.3f + 0.7f * opening);
  for (int c = 0; c < 3; c++) light.diffuse[c] = lights.ambient(c) * up, light.highlight[c] = 0.0f;
  for (i64 k = 0; k < lights.lamp_position.size(); k++) {
    const View<const float, 1> lamp = lights.lamp_position.row(k), colour = lights.lamp_colour.row(k);
    const float lx = lamp(0) - px, ly = lamp(1) - py, lz = lamp(2) - pz;
    float cosine = nx * lx + ny * ly + nz * lz;
    if (cosine <= 0.0f) continue;
    const float square = lx * lx + ly * ly + lz * lz;
    const float inverse = 1.0f / std::sqrt(square);
    cosine *= inverse;
    float strength = 5.0f / (1.0f + square);
    strength *= lit(maps, k + 1, px, py, pz, 2e-5f);
    for (int c = 0; c < 3; c++) light.diffuse[c] += colour(c) * strength * cosine;
    if (specular < 0.01f) continue;
    const float hx = lx * inverse - vx, hy = ly * inverse - vy, hz = lz * inverse - vz;
    float h = std::max(0.0f, (nx * hx + ny * hy + nz * hz) / std::sqrt(hx * hx + hy * hy + hz * hz + 1e-12f));
    for (int n = 0; n < gloss; n++) h *= h;
    const float peak = specular * h * strength * static_cast<float>(1 << gloss) * 0.08f;
    for (int c = 0; c < 3; c++) light.highlight[c] += colour(c) * peak;
  }
}

struct Camera {
  float fx, fy, cx, cy;
  View<const float, 2> R;
  View<const float, 1> eye;
};

// Find the light and the mip level of a pixel on face f of material m. `dx`, `dy` are its ray at depth 1, `ox`, `oy` its
// place in the face's bounds.
inline void enlighten(i64 f, i64 m, float z, float dx, float dy, float ox, float oy, const Camera &camera,
                      View<const float, 3> edges, const Faces &s, const Lights &lights, const Maps &maps,
                      Light &light) {
  const View<const float, 2> R = camera.R;
  const View<const float, 1> eye = camera.eye;
  const float rx = R(0, 0) * dx + R(0, 1) * dy + R(0, 2);
  const float ry = R(1, 0) * dx + R(1, 1) * dy + R(1, 2);
  const float rz = R(2, 0) * dx + R(2, 1) * dy + R(2, 2);
  float n[3];
  for (int c = 0; c < 3; c++) {
    Plane normal;
    load(s.normals, s.faces, edges, f, c, normal);
    n[c] = value(normal, ox, oy, z);
  }
  const float ray = 1.0f / std::sqrt(rx * rx + ry * ry + rz * rz);
  float norm = 1.0f / std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + 1e-12f);
  const float facing = (n[0] * rx + n[1] * ry + n[2] * rz) * norm;
  if (s.open_surface(f) && facing > 0.0f) norm = -norm;
  light.level = mip_level(s.texture_size(m), s.level_start.shape[1], s.detail(f) * z / camera.fx,
                          std::abs(facing) * ray);
  illuminate(eye(0) + z * rx, eye(1) + z * ry, eye(2) + z * rz, n[0] * norm, n[1] * norm, n[2] * norm, rx * ray,
             ry * ray, rz * ray, s.response(m, 0), static_cast<int>(s.response(m, 1)), lights, maps, light);
}

// How much nearness grows one pixel to the right and one down, on the face of `edges` (3, 3).
inline float slope(View<const float, 2> edges) {
  float total = 0.0f;
  for (int k = 0; k < 3; k++) total += edges(k, 1) + edges(k, 2);
  return total;
}

// Colour the rows y_first..y_last. Light changes slowly over a face: it is found for every second pixel of every second
// row, and for the others only where they see another face than that one, and so is the mip level. `y_first` is even.
// `light_scale` is of the square root of light in `out`.
inline void shade(View<const float, 2> nearness, View<const i32, 2> triangle, i64 y_first, i64 y_last,
                  std::array<float, 4> pinhole, View<const float, 2> R, View<const float, 1> eye,
                  View<const i32, 2> bounds, View<const float, 3> edges,
                  std::tuple<View<const i32, 2>, View<const float, 2>, View<const float, 2>, View<const i32, 1>,
                             View<const float, 1>, View<const bool, 1>, View<const u8, 2>, View<const i32, 2>,
                             View<const i32, 1>, View<const float, 2>>
                      surfaces,
                  std::tuple<View<const float, 2>, View<const float, 2>, View<const float, 1>> lamps,
                  std::tuple<View<const float, 4>, View<const float, 3>, View<const float, 2>, View<const float, 2>,
                             View<const float, 1>>
                      shadow_maps,
                  double light_scale, View<u16, 3> out) {
  const Faces s = std::apply([](auto... part) { return Faces{part...}; }, surfaces);
  const Lights lights = std::apply([](auto... part) { return Lights{part...}; }, lamps);
  const Maps maps = std::apply([](auto... part) { return Maps{part...}; }, shadow_maps);
  const Camera camera = {pinhole[0], pinhole[1], pinhole[2], pinhole[3], R, eye};
  const i64 width = triangle.shape[1], own = (width + 1) / 2;
  const float scale = static_cast<float>(light_scale);
  Array<Light, 1> kept(own + 1);  // the last is for a pixel that keeps its light to itself
  auto lit_face = full<i32, 1>(-1, own);
  Plane picture[2] = {};
  float albedo[3];
  i64 loaded = -1, m = 0;
  for (i64 y = y_first; y < y_last; y++) {
    const float dy = (static_cast<float>(y) - camera.cy) / camera.fy;
    for (i64 x = 0; x < width; x++) {
      const i32 f = triangle(y, x);
      const i64 j = x >> 1;
      const bool keeps = ((x | y) & 1) == 0, shared = !keeps && lit_face(j) == f;
      if (keeps) lit_face(j) = f;
      if (f < 0) {
        out(y, x, 0) = 0, out(y, x, 1) = 0, out(y, x, 2) = 0;
        continue;
      }
      const float z = 1.0f / nearness(y, x);
      if (f != loaded) {
        loaded = f, m = s.material(f);
        for (int c = 0; c < 2; c++) load(s.uv, s.faces, edges, f, c, picture[c]);
      }
      const float ox = static_cast<float>(x - bounds(f, 0)), oy = static_cast<float>(y - bounds(f, 1));
      Light &light = kept(keeps || shared ? j : own);
      if (!shared) {
        const float beside = keeps ? 0.5f : 0.0f;  // px: the light of a block is that of its middle
        const float lit_z = 1.0f / std::max(nearness(y, x) + beside * slope(edges.row(f)), FARTHEST);
        const float dx = (static_cast<float>(x) + beside - camera.cx) / camera.fx, lit_dy = dy + beside / camera.fy;
        enlighten(f, m, lit_z, dx, lit_dy, ox + beside, oy + beside, camera, edges, s, lights, maps, light);
      }
      const float tu = value(picture[0], ox, oy, z), tv = value(picture[1], ox, oy, z);
      texel(s.texels, s.level_start(m, light.level.number), light.level.size, tu, tv, albedo);
      for (int c = 0; c < 3; c++) {
        const float level = albedo[c] * (light.diffuse[c] + s.response(m, 2)) + light.highlight[c];
        out(y, x, c) = static_cast<u16>(std::min(65535.0f, std::sqrt(level) * scale));
      }
    }
  }
}

inline PyMethodDef METHODS[] = {
    binding::method<shade>("shade", "Colour rows of an image."),
    {nullptr, nullptr, 0, nullptr},
};
}  // namespace objreg::shade
