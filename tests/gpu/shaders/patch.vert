#version 460
// A vertex is a patch: passes its number on.
layout(location = 0) out uint patch_number;

void main() { patch_number = gl_VertexIndex; }
