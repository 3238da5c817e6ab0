#version 460
// Column x gets the bytes (x, x, x, 255).
layout(local_size_x = 64) in;
layout(set = 0, binding = 0) writeonly uniform image2D image;

void main() {
  float code = float(gl_GlobalInvocationID.x) / 255.0;
  imageStore(image, ivec2(gl_GlobalInvocationID.x, 0), vec4(code, code, code, 1.0));
}
