// Reads: the source picture. Writes: its colour, still sRGB-encoded.
#version 460

layout(set = 0, binding = 1) uniform sampler2D source;

layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;

void main() { color = vec4(textureLod(source, uv, 0.0).rgb, 1.0); }
