#version 460
// Reads the middle of one texture out of an array whose size is a specialization constant.
layout(local_size_x = 1) in;
layout(constant_id = 0) const uint kTextures = 1;
layout(set = 0, binding = 0) uniform sampler2D textures[kTextures];
layout(std430, set = 0, binding = 1) buffer Result { vec4 results[]; };
layout(push_constant) uniform Push { uint index; };

void main() { results[index] = textureLod(textures[index], vec2(0.5), 0.0); }
