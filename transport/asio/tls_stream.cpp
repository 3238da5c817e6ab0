#include <boost/asio/ssl.hpp>
#include <utility>

#include "transport/asio/byte_stream.h"

namespace tessera::transport {

namespace ssl = asio::ssl;

struct TlsContext::Impl {
  explicit Impl(bool is_server)
      : server(is_server), context(is_server ? ssl::context::tls_server : ssl::context::tls_client) {
    context.set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 | ssl::context::no_sslv3 |
                        ssl::context::no_tlsv1 | ssl::context::no_tlsv1_1);
  }
  bool server;
  ssl::context context;
  std::string server_name;
};

namespace {

class TlsStream final : public ByteStream {
 public:
  TlsStream(std::shared_ptr<void> context_owner, ssl::context& context, bool server,
            const std::string& server_name, asio::ip::tcp::socket socket)
      : context_owner_(std::move(context_owner)), server_(server), stream_(std::move(socket), context) {
    if (server) return;
    SSL_set_tlsext_host_name(stream_.native_handle(), server_name.c_str());
    stream_.set_verify_callback(ssl::host_name_verification(server_name));
  }

  void async_handshake(std::function<void(SystemError)> handler) override {
    stream_.async_handshake(server_ ? ssl::stream_base::server : ssl::stream_base::client,
                            std::move(handler));
  }
  void async_read_some(asio::mutable_buffer buffer, Handler handler) override {
    stream_.async_read_some(buffer, std::move(handler));
  }
  void async_write_some(asio::const_buffer buffer, Handler handler) override {
    stream_.async_write_some(buffer, std::move(handler));
  }
  void close() override {
    SystemError ignored;
    stream_.lowest_layer().shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
    stream_.lowest_layer().close(ignored);
  }
  asio::any_io_executor executor() override { return stream_.get_executor(); }

 private:
  std::shared_ptr<void> context_owner_;
  bool server_;
  ssl::stream<asio::ip::tcp::socket> stream_;
};

Status file_error(const char* what, const std::string& file, SystemError error) {
  return absl::InvalidArgumentError(
      absl::StrCat("TLS: cannot use `", file, "` as ", what, ": ", error.message()));
}

}  // namespace

TlsContext::TlsContext(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
TlsContext::~TlsContext() = default;

StatusOr<std::shared_ptr<TlsContext>> TlsContext::server(const TlsServerSettings& settings) {
  auto impl = std::make_shared<Impl>(true);
  SystemError error;
  impl->context.use_certificate_chain_file(settings.certificate_chain_file, error);
  if (error) return file_error("certificate chain", settings.certificate_chain_file, error);
  impl->context.use_private_key_file(settings.private_key_file, ssl::context::pem, error);
  if (error) return file_error("private key of that certificate", settings.private_key_file, error);
  return std::shared_ptr<TlsContext>(new TlsContext(std::move(impl)));
}

StatusOr<std::shared_ptr<TlsContext>> TlsContext::client(const TlsClientSettings& settings) {
  auto impl = std::make_shared<Impl>(false);
  impl->server_name = settings.server_name;
  impl->context.set_verify_mode(ssl::verify_peer);
  SystemError error;
  if (settings.authority_file.empty()) {
    impl->context.set_default_verify_paths(error);
  } else {
    impl->context.load_verify_file(settings.authority_file, error);
  }
  if (error) return file_error("certificate authority", settings.authority_file, error);
  return std::shared_ptr<TlsContext>(new TlsContext(std::move(impl)));
}

std::unique_ptr<ByteStream> TlsContext::make_stream(asio::ip::tcp::socket socket) const {
  return std::make_unique<TlsStream>(impl_, impl_->context, impl_->server, impl_->server_name,
                                     std::move(socket));
}

}  // namespace tessera::transport
