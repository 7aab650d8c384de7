// SPDX-License-Identifier: MIT
#include "decoder.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    fuzz_decoder(DRV_FRAMING_WITMOTION, data, size);
    return 0;
}
