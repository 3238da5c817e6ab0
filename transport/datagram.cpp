#include "transport/datagram.h"

#include <algorithm>

namespace tessera::transport {
namespace {

constexpr uint8_t kHello = 4, kHelloAnswer = 5, kPose = 6;

Status malformed(const char* what, size_t bytes) {
  return absl::InvalidArgumentError(absl::StrCat(what, " datagram of ", bytes, " bytes is malformed"));
}

ByteWriter begin(Datagram& out, uint8_t kind, uint8_t version, uint8_t detail) {
  ByteWriter w(out);
  w.u8(kind);
  w.u8(version);
  w.u8(detail);
  w.u8(0);
  return w;
}

}  // namespace

DatagramKind classify(std::span<const uint8_t> datagram) {
  if (datagram.size() < 2) return DatagramKind::unknown;
  const uint8_t first = datagram[0], second = datagram[1];
  if (first == kHello) return DatagramKind::hello;
  if (first == kHelloAnswer) return DatagramKind::hello_answer;
  if (first == kPose) return DatagramKind::pose;
  if (first < 128 || first > 191) return DatagramKind::unknown;
  return second >= 192 && second <= 223 ? DatagramKind::rtcp : DatagramKind::rtp;
}

Datagram write_hello(const HelloDatagram& hello) {
  Datagram out;
  ByteWriter w = begin(out, kHello, hello.version, 0);
  w.bytes(hello.token);
  w.u64(hello.nonce);
  return out;
}

StatusOr<HelloDatagram> parse_hello(std::span<const uint8_t> datagram) {
  ByteReader in(datagram);
  const uint8_t kind = in.u8();
  HelloDatagram hello;
  hello.version = in.u8();
  in.skip(2);
  const std::span<const uint8_t> token = in.bytes(hello.token.size());
  std::ranges::copy(token, hello.token.begin());
  hello.nonce = in.u64();
  const bool length = hello.version == kDatagramVersion ? in.done() : in.ok();
  if (kind != kHello || !length) return malformed("hello", datagram.size());
  return hello;
}

Datagram write_hello_answer(const HelloAnswer& answer) {
  Datagram out;
  ByteWriter w = begin(out, kHelloAnswer, answer.version, static_cast<uint8_t>(answer.status));
  w.u64(answer.nonce);
  return out;
}

StatusOr<HelloAnswer> parse_hello_answer(std::span<const uint8_t> datagram) {
  ByteReader in(datagram);
  const uint8_t kind = in.u8();
  HelloAnswer answer;
  answer.version = in.u8();
  const uint8_t status = in.u8();
  answer.status = static_cast<HelloStatus>(status);
  in.skip(1);
  answer.nonce = in.u64();
  if (kind != kHelloAnswer || !in.done() || status > 1) return malformed("hello answer", datagram.size());
  return answer;
}

Datagram write_pose_datagram(const SequencedPose& pose) {
  Datagram out;
  ByteWriter w = begin(out, kPose, kDatagramVersion, 0);
  write_pose(pose, w);
  return out;
}

StatusOr<SequencedPose> parse_pose_datagram(std::span<const uint8_t> datagram) {
  ByteReader in(datagram);
  const uint8_t kind = in.u8(), version = in.u8();
  in.skip(2);
  const SequencedPose pose = read_pose(in);
  if (kind != kPose || version != kDatagramVersion || !in.done()) return malformed("pose", datagram.size());
  return pose;
}

}  // namespace tessera::transport
