// What is asked of each compilation of atlas/addressing, and its C++ answers.
#pragma once

#include <vector>

#include "atlas/addressing/addressing.h"

namespace tessera::atlas::addressing::test {

using glm::ivec4, glm::vec4;

// Meaning of `n` and `x`: shaders/evaluate.glsl.
struct Question {
  ivec4 n{0};
  vec4 x{0};
};

// Every function, with all levels, counts and tips where these are few enough.
int function_count();
const char* function_name(int function);
std::vector<Question> questions(int function);

// The answer to a question has its shape.
std::vector<Question> answered(int function, const std::vector<Question>& questions);

}  // namespace tessera::atlas::addressing::test
