// The operator's token: what lets a program call a daemon's control service. Each call carries it in its
// metadata as `authorization: Bearer TOKEN`.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "base/status.h"

namespace tessera {

// The first line of `file`: 16 to 1024 printable ASCII characters without blanks. InvalidArgument: it is not,
// or users other than the file's owner and group may read or change it. The message shows nothing of what is
// in it.
StatusOr<std::string> read_control_token(const std::string& file);

// What a call came back with, as one of ours: the codes have the same numbers.
Status to_status(const grpc::Status& status, const std::string& call);

// A channel whose every call carries the token; empty: none does. What keeps the token secret on its way is
// up to `credentials`.
std::shared_ptr<grpc::Channel> control_channel(const std::string& endpoint,
                                               const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                               const std::string& token,
                                               const grpc::ChannelArguments& arguments = {});

}  // namespace tessera
