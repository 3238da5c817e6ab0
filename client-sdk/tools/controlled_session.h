// A session of a daemon's, asked for by gRPC.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/atlas_codec.h"
#include "base/status.h"
#include "client-sdk/ticket.h"
#include "proto/frame_reader.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera::client {

struct ControlSettings {
  std::string endpoint = "127.0.0.1:7310";    // host:port of the daemon's gRPC
  std::optional<std::string> authority_file;  // of TLS, for control and session; none: clear text
  std::string token_file;  // whose first line each call shows; empty: the daemon wants none
  bool insecure = false;   // show it in clear text beyond loopback
};

class ControlledSession {
 public:
  static StatusOr<std::unique_ptr<ControlledSession>> create(const ControlSettings& settings,
                                                             const std::string& scene,
                                                             const v1::SessionSettings& wanted = {});
  // Deletes it, unless it was kept.
  ~ControlledSession();

  const Ticket& ticket() const { return ticket_; }
  uint64_t id() const { return id_; }
  void keep() { kept_ = true; }
  // Of the scene.
  StatusOr<v1::Box> bounds();
  // From now on, for frames().
  void record_frames();
  // `last`: see FrameReader::finish().
  StatusOr<std::vector<FrameRecord>> frames(std::optional<FrameNumber> last);

 private:
  ControlledSession() = default;

  std::unique_ptr<v1::Control::Stub> stub_;
  uint64_t id_ = 0;
  std::string scene_;
  Ticket ticket_;
  bool kept_ = false;
  std::unique_ptr<FrameReader> reader_;
};

}  // namespace tessera::client
