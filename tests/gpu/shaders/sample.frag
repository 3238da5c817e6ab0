#version 460
// Sample s of 4 gets s / 3.
layout(location = 0) out vec4 result;

void main() { result = vec4(float(gl_SampleID) / 3.0); }
