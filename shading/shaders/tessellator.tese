#version 460
#extension GL_GOOGLE_include_directive : require
// Marks the places that gather.tese would fill.
#include "shading/shaders/tessellated.glsl"
#include "shading/shaders/tessellator.glsl"

layout(triangles, equal_spacing, point_mode) in;
layout(location = 0) patch in uint in_trial;

layout(set = 0, binding = 1, std430) buffer Marks { uint marks[]; };

void mark(Trial trial, int place, bool is_there) { atomicAdd(marks[is_there ? trial.first + 2u + uint(place) : trial.first + 1u], 1u); }

void mark_texel(Trial trial, ivec2 texel) {
  int side = trial.level + 1;
  bool is_there = texel.x >= 0 && texel.y >= 0 && texel.x < side && texel.y < side;
  mark(trial, texel.y * side + texel.x, is_there);
}

void main() {
  Trial trial = trials[in_trial];
  atomicAdd(marks[trial.first], 1u);
  if (trial.level > 0) {
    LTexels at = l_texels(gl_TessCoord, trial.level);
    mark_texel(trial, at.texel);
    if (at.copy != at.texel) mark_texel(trial, at.copy);
  } else {
    int id = oversampling_id(gl_TessCoord, tessellated_levels());
    mark(trial, id, id >= 0 && id < trial.samples);
  }
}
