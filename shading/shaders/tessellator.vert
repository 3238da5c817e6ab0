#version 460
#extension GL_GOOGLE_include_directive : require
// A vertex is a trial.
#include "shading/shaders/tessellator.glsl"

layout(location = 0) out uint out_number;
layout(location = 1) out vec4 out_levels;

void main() {
  Trial trial = trials[gl_VertexIndex];
  TessellationLevels levels = trial.level > 0 ? uniform_levels(trial.level) : tessellation_levels(trial.samples);
  out_number = uint(gl_VertexIndex);
  out_levels = vec4(levels.outer, levels.inner);
}
