#include "test_authority.h"

namespace marble::testing {

TestAuthority::TestAuthority() {
  openssl({"req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days",
           "30", "-subj", "/CN=test authority", "-keyout", directory_.file("authority.key"), "-out",
           certificate()});
}

CertificateFiles TestAuthority::issue(const std::string& common_name, const std::string& alternative_names,
                                      int days) {
  const std::string number = std::to_string(++issued_);
  CertificateFiles files = {directory_.file(number + ".pem"), directory_.file(number + ".key")};
  const std::string request = directory_.file(number + ".request");
  std::vector<std::string> arguments = {"req",
                                        "-newkey",
                                        "ec",
                                        "-pkeyopt",
                                        "ec_paramgen_curve:prime256v1",
                                        "-nodes",
                                        "-subj",
                                        "/CN=" + common_name,
                                        "-keyout",
                                        files.key,
                                        "-out",
                                        request};
  if (!alternative_names.empty())
    arguments.insert(arguments.end(), {"-addext", "subjectAltName=" + alternative_names});
  openssl(std::move(arguments));
  openssl({"x509", "-req", "-in", request, "-CA", certificate(), "-CAkey", directory_.file("authority.key"),
           "-set_serial", number, "-days", std::to_string(days), "-copy_extensions", "copy", "-out",
           files.certificate});
  return files;
}

void TestAuthority::openssl(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "/usr/bin/openssl");
  ChildProcess process(arguments, directory_.file("output"));
  if (process.wait() != 0) throw std::runtime_error("openssl: " + process.output());
}

}  // namespace marble::testing
