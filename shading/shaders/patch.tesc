#version 460
// A patch is one vertex, which brings its levels.
layout(vertices = 1) out;
layout(location = 0) in uint in_number[];
layout(location = 1) in vec4 in_levels[];  // of the outer edges, as in TessellationLevels, and of the inside

layout(location = 0) patch out uint out_number;

void main() {
  out_number = in_number[0];
  for (int i = 0; i < 3; ++i) gl_TessLevelOuter[i] = in_levels[0][i];
  gl_TessLevelInner[0] = in_levels[0].w;
}
