// For evaluation shaders.
#ifndef TESSERA_TESSELLATED_GLSL
#define TESSERA_TESSELLATED_GLSL

#include "atlas/addressing/tessellation.glsl"

// That the point's triangle was tessellated at.
TessellationLevels tessellated_levels() {
  TessellationLevels levels;
  levels.outer = ivec3(gl_TessLevelOuter[0], gl_TessLevelOuter[1], gl_TessLevelOuter[2]);
  levels.inner = int(gl_TessLevelInner[0]);
  return levels;
}

#endif
