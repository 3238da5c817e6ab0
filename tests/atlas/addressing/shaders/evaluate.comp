#version 460
#extension GL_GOOGLE_include_directive : require
// One thread a question.
#include "tests/atlas/addressing/shaders/evaluate.glsl"

layout(local_size_x = 64) in;

struct Question {
  ivec4 n;
  vec4 x;
};

layout(set = 0, binding = 0, std430) readonly buffer Questions { Question questions[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Answers { Answer answers[]; };
layout(push_constant) uniform Pass { int function; } pass;

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i < questions.length()) answers[i] = evaluate(pass.function, questions[i].n, questions[i].x);
}
