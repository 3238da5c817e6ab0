#version 460
// Reads one layer of an array at one mip level, and writes its double to the storage image of another level.
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) uniform sampler2DArray source;
layout(set = 0, binding = 1, r32f) uniform image2D target;
layout(push_constant) uniform Push { float layer; float lod; };

void main() { imageStore(target, ivec2(0), 2.0 * textureLod(source, vec3(0.5, 0.5, layer), lod)); }
