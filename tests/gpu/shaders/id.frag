#version 460
// 1 + the instance number, so that 0 means background.
layout(location = 0) flat in uint instance;
layout(location = 0) out uint id;

void main() { id = instance + 1u; }
