// brdf.glsl and color.glsl as C++: the shaders' own text, for known answers.
#pragma once

#include "base/math.h"

// An unnamed namespace: the text defines functions that are not inline.
namespace tessera::shading::test {
namespace {
using namespace glm;
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include "shading/shaders/brdf.glsl"
#include "shading/shaders/color.glsl"
#pragma GCC diagnostic pop
}  // namespace
}  // namespace tessera::shading::test
