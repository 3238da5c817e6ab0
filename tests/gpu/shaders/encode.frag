#version 460
// Column x gets the linear light whose sRGB code is x.
layout(location = 0) out vec4 result;

void main() {
  float code = floor(gl_FragCoord.x) / 255.0;
  float linear = code <= 0.04045 ? code / 12.92 : pow((code + 0.055) / 1.055, 2.4);
  result = vec4(linear, linear, linear, 1.0);
}
