// A self-signed certificate for tests, of a name and of 127.0.0.1 (a bare machine may not even resolve
// localhost), in files that go away with it.
#pragma once

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

namespace tessera::transport::test {

class Certificate {
 public:
  // Valid from an hour ago until `valid_seconds` from now.
  explicit Certificate(const std::string& name, long valid_seconds = 3600) {
    char pattern[] = "/tmp/tessera-certificate-XXXXXX";
    folder_ = mkdtemp(pattern);
    const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(EVP_EC_gen("P-256"), &EVP_PKEY_free);
    const std::unique_ptr<X509, decltype(&X509_free)> x509(X509_new(), &X509_free);
    X509_set_version(x509.get(), 2);
    ASN1_INTEGER_set(X509_get_serialNumber(x509.get()), 1);
    X509_gmtime_adj(X509_getm_notBefore(x509.get()), -3600);
    X509_gmtime_adj(X509_getm_notAfter(x509.get()), valid_seconds);
    X509_set_pubkey(x509.get(), key.get());
    X509_NAME* subject = X509_get_subject_name(x509.get());
    X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                               reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
    X509_set_issuer_name(x509.get(), subject);
    X509_EXTENSION* alternative = X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name,
                                                      ("DNS:" + name + ",IP:127.0.0.1").c_str());
    X509_add_ext(x509.get(), alternative, -1);
    X509_EXTENSION_free(alternative);
    X509_sign(x509.get(), key.get(), EVP_sha256());
    write(certificate_file(), [&](FILE* f) { PEM_write_X509(f, x509.get()); });
    write(key_file(),
          [&](FILE* f) { PEM_write_PrivateKey(f, key.get(), nullptr, nullptr, 0, nullptr, nullptr); });
  }
  ~Certificate() { std::filesystem::remove_all(folder_); }
  Certificate(const Certificate&) = delete;

  std::string certificate_file() const { return folder_ + "/certificate.pem"; }
  std::string key_file() const { return folder_ + "/key.pem"; }

 private:
  template <class Write>
  static void write(const std::string& file, Write&& content) {
    FILE* f = std::fopen(file.c_str(), "w");
    content(f);
    std::fclose(f);
  }
  std::string folder_;
};

}  // namespace tessera::transport::test
