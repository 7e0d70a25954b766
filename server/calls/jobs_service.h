// The service marble.v1.Jobs on gRPC's callback API: jobs by their ids.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "service/admission.h"
#include "service/service_parts.h"

namespace marble::server {

using JobsRawService = v1::Jobs::WithRawCallbackMethod_Submit<
    v1::Jobs::WithRawCallbackMethod_Result<v1::Jobs::WithRawCallbackMethod_Delete<
        v1::Jobs::WithRawCallbackMethod_List<v1::Jobs::WithRawCallbackMethod_Get<
            v1::Jobs::WithRawCallbackMethod_Cancel<v1::Jobs::WithRawCallbackMethod_Watch<
                v1::Jobs::WithRawCallbackMethod_Bundle<v1::Jobs::WithRawCallbackMethod_SubmitArray<
                    v1::Jobs::WithRawCallbackMethod_ArrayResults<v1::Jobs::Service>>>>>>>>>>;

/// The methods read and write bytes; see wire.h.
class JobsService final : public JobsRawService {
 public:
  explicit JobsService(const ServiceParts& parts);

  grpc::ServerUnaryReactor* Submit(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                   grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* Delete(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                   grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* List(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                 grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* Get(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* Cancel(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                   grpc::ByteBuffer* response) override;

 private:
  const ServiceParts& parts_;
};

}  // namespace marble::server
