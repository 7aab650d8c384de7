// SPDX-License-Identifier: MIT
// Any bytes as the state of a stream, of sums or of correlations, with their check sums made right: taken, or refused in one
// line. What is taken goes on: samples are added, sums read, and it is written again.
#include "live/stream_state.hpp"
#include "text_file.hpp"

#include <drv/crc.h>
#include <okid/accumulator.h>
#include <okid/correlation.h>

#include <memory>

namespace {

constexpr std::size_t most_memory = 16u << 20;

void repair(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t sum) {
    for (int k = 0; k < 4; ++k) bytes[at + static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(sum >> (8 * k));
}

/// Behind a head, or samples without one.
void stream(std::vector<std::uint8_t> bytes, bool head) {
    okid_host::stream_config config;
    config.inputs = {"f"};
    config.outputs = {"a", "b"};
    config.rate_hz = 100;
    config.wanted.method = head ? "auto" : "okid-era";
    const void* from = bytes.data();
    std::size_t count = bytes.size();
    if (head) {
        if (bytes.size() >= 20)
            repair(bytes, 16, drv_crc32(drv_crc32(0, bytes.data(), 16), bytes.data() + 20, bytes.size() - 20));
        const okid_host::state_body body = okid_host::behind_head(config, from, count);
        from = body.from;
        count = body.bytes;
    }
    const okid_host::saved_samples found = okid_host::read_samples("", 1, 2, from, count);
    const std::size_t samples = found.ends.empty() ? 0 : static_cast<std::size_t>(found.ends.back());
    if (found.rows.size() != 3 * samples) std::abort();
    if (okid_host::samples_body(1, 2, found).size() != count) std::abort();
}

void sums(const std::vector<std::uint8_t>& bytes) {
    okid_accumulator_config_t config{};
    if (okid_accumulator_peek(bytes.data(), bytes.size(), &config) != OKID_OK) return;
    const std::size_t size = okid_accumulator_memsize(&config);
    if (size == 0 || size > most_memory) return;
    const std::unique_ptr<std::byte[]> block(new std::byte[size]);
    okid_accumulator_t* made = nullptr;
    if (okid_accumulator_create(&made, &config, block.get(), size) != OKID_OK) return;
    if (okid_accumulator_deserialise(made, bytes.data(), bytes.size()) != OKID_OK) return;
    const auto m = static_cast<std::size_t>(config.n_u + config.n_y),
               lagged = m * static_cast<std::size_t>(config.lags + 1);
    if (lagged > 64) return;
    const std::vector<double> rows(3 * m, 0.5);
    if (config.sample == OKID_SAMPLE_DOUBLE) (void)!okid_accumulator_add(made, rows.data(), 3);
    okid_accumulator_gap(made, 2);
    std::vector<double> gram(lagged * lagged), mean(m);
    (void)!okid_accumulator_gram(made, OKID_DETREND_MEAN, gram.data(), mean.data());
    std::vector<std::byte> again(okid_accumulator_serialised_size(made));
    if (okid_accumulator_serialise(made, again.data(), again.size()) != OKID_OK) std::abort();
}

void correlations(const std::vector<std::uint8_t>& bytes) {
    okid_correlation_config_t config{};
    if (okid_correlation_peek(bytes.data(), bytes.size(), &config) != OKID_OK) return;
    const std::size_t size = okid_correlation_memsize(&config);
    if (size == 0 || size > most_memory) return;
    const std::unique_ptr<std::byte[]> block(new std::byte[size]);
    okid_correlation_t* made = nullptr;
    if (okid_correlation_create(&made, &config, block.get(), size) != OKID_OK) return;
    if (okid_correlation_deserialise(made, bytes.data(), bytes.size()) != OKID_OK) return;
    const std::vector<double> rows(3 * static_cast<std::size_t>(config.n_u + config.n_y), 0.5);
    if (config.sample == OKID_SAMPLE_DOUBLE) (void)!okid_correlation_add(made, rows.data(), 3);
    okid_correlation_gap(made, 2);
    std::vector<std::byte> again(okid_correlation_serialised_size(made));
    if (okid_correlation_serialise(made, again.data(), again.size()) != OKID_OK) std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 5) return 0;
    std::vector<std::uint8_t> bytes(data + 1, data + size);
    if (data[0] % 4 < 2) return okid_fuzz::expect_value_or_refusal([&] { stream(std::move(bytes), data[0] % 4 == 0); });
    repair(bytes, bytes.size() - 4, drv_crc32(0, bytes.data(), bytes.size() - 4));
    data[0] % 4 == 2 ? sums(bytes) : correlations(bytes);
    return 0;
}
