#include "server/doctor.h"

#include <openssl/pem.h>
#include <openssl/x509.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "codec/video_encoder.h"
#include "gpu/device.h"
#include "scene/procedural.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

namespace fs = std::filesystem;
using Detail = StatusOr<std::string>;

Detail described(const Status& status, std::string detail) {
  if (!status.ok()) return status;
  return detail;
}

Detail check_expiry(const std::string& file) {
  const std::unique_ptr<BIO, decltype(&BIO_free)> in(BIO_new_file(file.c_str(), "r"), &BIO_free);
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(
      in ? PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr) : nullptr, &X509_free);
  if (!certificate) return absl::InvalidArgumentError(absl::StrCat(file, " holds no certificate"));
  int days = 0, seconds = 0;
  ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(certificate.get()));
  if (days < 0 || seconds < 0)
    return absl::FailedPreconditionError(
        absl::StrCat("the certificate ", file, " has expired: clients will refuse it; renew it"));
  return absl::StrCat("TLS and SRTP, with a certificate that fits its key, for ", days, " days more");
}

Detail check_configuration(const DaemonSettings& settings) {
  const auto stream = stream_settings(settings);
  if (!stream.ok()) return stream.status();
  if (stream->meta.tls) return check_expiry(settings.tls_certificate);
  return settings.insecure ? "clear text, as --insecure says" : "clear text, on loopback";
}

Detail check_control_token(const DaemonSettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(const std::string token, control_token(settings));
  if (!token.empty()) return "calls must show the one in " + settings.control_token_file;
  return settings.insecure ? "none: whoever reaches the control port steers the daemon, as --insecure says"
                           : "none: every program on this machine may steer the daemon";
}

Detail check_tcp(const DaemonSettings& settings, uint16_t port) {
  TESSERA_ASSIGN_OR_RETURN(const auto address, transport::parse_address(settings.address));
  return described(transport::check_tcp_port("TCP", address, port), transport::to_string(address, port));
}

Detail check_udp(const DaemonSettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(const auto address, transport::parse_address(settings.address));
  return described(transport::check_udp_port(address, settings.media_port),
                   transport::to_string(address, settings.media_port));
}

Detail check_scene(const std::string& option) {
  TESSERA_ASSIGN_OR_RETURN(const auto scene, name_and_source(option));
  if (scene::is_procedural(scene.second)) return scene.second;
  if (std::ifstream(scene.second).good() && !fs::is_directory(scene.second)) return scene.second;
  return absl::NotFoundError(absl::StrCat("cannot read ", scene.second,
                                          ": check the path and who may read it (the daemon's user must)"));
}

Detail check_scene_root(const std::string& root) {
  if (root.empty()) return "none: LoadScene reads no files";
  std::error_code error;
  fs::directory_iterator(root, error);
  if (!error) return root;
  return absl::NotFoundError(absl::StrCat("--scene-root ", root, ": ", error.message()));
}

Detail check_device(const std::string& select) {
  const auto device = gpu::Device::create({.select = select});
  if (!device.ok()) return device.status();
  return absl::StrCat((*device)->info().name, " (", (*device)->info().driver, ")");
}

}  // namespace

StatusOr<std::string> choose_encoder() {
  TESSERA_ASSIGN_OR_RETURN(const auto encoder, codec::VideoEncoder::create({.width = 256, .height = 256}));
  return encoder->choice();
}

std::vector<Finding> examine(const DaemonSettings& settings) {
  std::vector<Finding> findings;
  const auto add = [&](std::string check, const Detail& detail) {
    findings.push_back({std::move(check), detail.status(), detail.ok() ? *detail : std::string()});
  };
  add("configuration", check_configuration(settings));
  add("control token", check_control_token(settings));
  add("control port", check_tcp(settings, settings.control_port));
  add("meta port", check_tcp(settings, settings.meta_port));
  add("media port", check_udp(settings));
  if (!settings.no_http) add("http port", check_tcp(settings, settings.http_port));
  add("scene root", check_scene_root(settings.scene_root));
  for (const std::string& scene : settings.scenes) add("scene", check_scene(scene));
  add("device", check_device(settings.device));
  add("encoder", choose_encoder());
  return findings;
}

}  // namespace tessera::server
