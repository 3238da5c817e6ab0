// What run_tessellator() asks. C++ twin: shading/tessellator.cpp.
#ifndef TESSERA_TESSELLATOR_GLSL
#define TESSERA_TESSELLATOR_GLSL

#include "atlas/addressing/l_packing.glsl"
#include "atlas/addressing/oversampling.glsl"

struct Trial {
  int level;    // of all edges and the inside; 0: `samples` decides
  int samples;
  uint first;   // its words in marks[]: evaluations, marks elsewhere, marks by place
};

layout(set = 0, binding = 0, std430) readonly buffer Trials { Trial trials[]; };

#endif
