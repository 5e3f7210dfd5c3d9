#include "google/protobuf/stubs/logging.h"

// libFuzzer calls it first: protobuf shall not tell of each string that is no UTF-8.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  google::protobuf::SetLogHandler(nullptr);
  return 0;
}
