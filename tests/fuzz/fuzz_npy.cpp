// SPDX-License-Identifier: MIT
// Any bytes as an .npy file: as many numbers as samples and columns, or a refusal.
#include "record/npy.hpp"
#include "text_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string path = okid_fuzz::file_of(data, size);
    return okid_fuzz::expect_value_or_refusal([&] {
        okid_host::csv_request request;
        request.fs_hz = 100;
        request.columns = okid_host::read_npy_columns(path);
        if (request.columns.size() > 2) request.columns.resize(2);
        const okid_host::csv_record record = okid_host::read_npy(path, request);
        if (record.samples.size() != record.count * request.columns.size()) std::abort();
    });
}
