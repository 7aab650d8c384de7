// SPDX-License-Identifier: MIT
// Any text as a CSV record: as many numbers as samples and columns, or a refusal.
#include "record/csv.hpp"
#include "text_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string path = okid_fuzz::file_of(data, size);
    return okid_fuzz::expect_value_or_refusal([&] {
        okid_host::csv_request request;
        request.columns = okid_host::read_csv_columns(path);
        if (request.columns.size() > 2) request.columns.resize(2); // the rest is skipped unread
        const okid_host::csv_record record = okid_host::read_csv(path, request);
        if (record.samples.size() != record.count * request.columns.size() || !(record.fs_hz > 0)) std::abort();
    });
}
