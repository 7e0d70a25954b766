#include "service/read_first.h"

#include "marble/v1/service.pb.h"

namespace marble::server {

void UnaryReadFirst::Finish(grpc::Status status) {
  if (status.ok()) {
    outer_.StartWriteAndFinish(&outer_.response_, grpc::WriteOptions(), std::move(status));
  } else {
    outer_.Finish(std::move(status));
  }
}

void UnaryReadFirst::SendInitialMetadata() { outer_.StartSendInitialMetadata(); }

void StreamReadFirst::Finish(grpc::Status status) { outer_.Finish(std::move(status)); }

void StreamReadFirst::SendInitialMetadata() { outer_.StartSendInitialMetadata(); }

void StreamReadFirst::Write(const grpc::ByteBuffer* message, grpc::WriteOptions options) {
  outer_.StartWrite(message, options);
}

void StreamReadFirst::WriteAndFinish(const grpc::ByteBuffer* message, grpc::WriteOptions options,
                                     grpc::Status status) {
  outer_.StartWriteAndFinish(message, options, std::move(status));
}

int method_number(const char* service, const char* method) {
  return v1::SolveRequest::descriptor()
      ->file()
      ->pool()
      ->FindMethodByName(std::string("marble.v1.") + service + "." + method)
      ->index();
}

}  // namespace marble::server
