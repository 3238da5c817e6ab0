// The one text of these files is read as GLSL 4.60 (shading/), as GLSL ES 3.00 (client-sdk/, WebGL2) and as C++ over glm
// (addressing.h). It therefore has f suffixes, no swizzles, no `out` parameters, explicit conversions, and no names that one of
// the three reserves. An ES shader sets `precision highp` for float and int before it.
//
// Integer positions are whole texels; continuous positions have a texel's centre at its integer, so that a sampler's
// coordinate is the position + 0.5. Integer divisions are of numbers >= 0.
#ifndef TESSERA_ADDRESSING_LANGUAGE_GLSL
#define TESSERA_ADDRESSING_LANGUAGE_GLSL

#ifdef __cplusplus
#define INLINE inline
#else
#define INLINE
#endif

#endif
