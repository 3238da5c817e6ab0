// GLSL that several passes share.
#pragma once

namespace tessera::client::gles {

// Reads: nothing. Writes: one triangle that covers the viewport, and where in it a pixel lies (0..1, +y up).
constexpr const char* kFullScreenVertex = R"(#version 300 es
out highp vec2 position;
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
  position = 0.5 * gl_Position.xy + 0.5;
}
)";

// What a fragment shader that writes a picture begins with. Pictures are sRGB-encoded; a target that encodes
// by itself needs them linear.
constexpr const char* kPicturePrelude = R"(#version 300 es
precision highp float;
precision highp int;
uniform bool srgb_target;
vec3 for_target(vec3 encoded) {
  if (!srgb_target) return encoded;
  vec3 c = clamp(encoded, 0.0, 1.0);
  return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));  // IEC 61966-2-1
}
)";

}  // namespace tessera::client::gles
