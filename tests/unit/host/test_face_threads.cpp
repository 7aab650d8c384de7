// SPDX-License-Identifier: MIT
// okid_host.h as Python uses it from several threads: one object in turns, closed while others want it, and objects of their
// own at the same time. What races is found by ThreadSanitizer (tests/sanitize/run thread), what leaks by AddressSanitizer.
#include <okid_host.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <unity.h>
#include <vector>

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr std::size_t channels = 3, samples = 1500;
constexpr const char* named = R"({"inputs": ["f"], "outputs": ["a", "b"], "fs": 100, "method": "okid-era", "p": 8})";
constexpr const char* agreed = R"({"inputs": ["f"], "outputs": ["a", "b"], "fs": 100})";

/// A force, and two masses that answer it.
std::vector<double> rows() {
    std::vector<double> out;
    std::array<double, 4> x{};
    std::uint32_t dice = 1;
    for (std::size_t n = 0; n < samples; ++n) {
        dice = dice * 1664525u + 1013904223u;
        const double f = static_cast<double>(dice >> 8) / (1 << 23) - 1;
        const auto turn = [&](double& re, double& im, double radius, double angle) {
            const double was = re;
            re = radius * (std::cos(angle) * re - std::sin(angle) * im) + f;
            im = radius * (std::sin(angle) * was + std::cos(angle) * im);
        };
        out.insert(out.end(), {f, x[0] + 0.4 * x[2], 0.5 * x[0] - x[2]});
        turn(x[0], x[1], 0.985, 0.4);
        turn(x[2], x[3], 0.98, 1.3);
    }
    return out;
}

const std::vector<double>& record() {
    static const std::vector<double> out = rows();
    return out;
}

void together(const std::vector<std::function<void()>>& works) {
    std::vector<std::thread> threads;
    threads.reserve(works.size());
    for (const auto& work : works) threads.emplace_back(work);
    for (std::thread& one : threads) one.join();
}

okid_host_stream_t* made(const char* options) {
    okid_host_stream_t* out = nullptr;
    if (okid_host_stream_create(options, nullptr, &out) != 0) {
        std::fprintf(stderr, "%s\n", okid_host_error());
        std::abort();
    }
    return out;
}

std::size_t modes_in(okid_host_result_t* result) {
    const char* text = okid_host_result_summary(result);
    std::size_t count = 0;
    for (const char* at = text; (at = std::strstr(at, "\"frequency_hz\"")); ++at) ++count;
    return count;
}

/// An object that threads take in turns, as okid.abi.turns has it.
struct shared_stream {
    std::mutex turn;
    okid_host_stream_t* stream = nullptr;

    /// @return false: it is closed
    template <class Use> bool use(const Use& work) {
        const std::lock_guard<std::mutex> mine(turn);
        if (stream) work(stream);
        return stream != nullptr;
    }
};

/// Two feed, one looks, one closes in the midst of it.
void feed_look_close(const char* options) {
    shared_stream one;
    one.stream = made(options);
    std::atomic<std::size_t> fed{0};
    const auto feed = [&] {
        constexpr std::size_t block = 50;
        for (std::size_t k = 0; k < samples; k += block)
            if (!one.use([&](okid_host_stream_t* self) {
                    if (okid_host_stream_add(self, OKID_HOST_DOUBLE, record().data() + k * channels, block) < 0)
                        std::abort();
                    fed += block;
                }))
                return;
    };
    const auto look = [&] {
        bool open = true;
        while (open)
            open = one.use([&](okid_host_stream_t* self) {
                okid_host_stream_counts_t counts{};
                if (okid_host_stream_stats(self, &counts) != 0) std::abort();
                okid_host_result_t* result = nullptr;
                if (counts.rows > 600 && okid_host_stream_update(self, &result) == 0 && result) (void)modes_in(result);
                okid_host_result_delete(result);
                const void* state = nullptr;
                std::size_t bytes = 0;
                if (okid_host_stream_state(self, &state, &bytes) == 0 && bytes == 0) std::abort();
            });
    };
    const auto close = [&] {
        while (fed < samples) std::this_thread::yield(); // half of what the two would feed
        const std::lock_guard<std::mutex> mine(one.turn);
        okid_host_stream_delete(one.stream);
        one.stream = nullptr;
    };
    together({feed, feed, look, close});
    TEST_ASSERT_FALSE(one.use([](okid_host_stream_t*) {}));
    TEST_ASSERT_TRUE(fed >= samples);
}

void test_one_object_is_fed_looked_at_and_closed() {
    feed_look_close(named);
    feed_look_close(R"({"inputs": ["f"], "outputs": ["a", "b"], "fs": 100, "method": "n4sid-cva", "window_s": 8})");
    feed_look_close(R"({"inputs": ["f"], "outputs": ["a", "b"], "fs": 100, "sigma_blocks": 0, "window_s": 7})");
}

/// A stream of one's own: fed, written, read by another one, identified.
std::size_t own_stream(const char* options) {
    okid_host_stream_t *first = made(options), *second = made(options);
    const void* state = nullptr;
    std::size_t bytes = 0, modes = 0;
    okid_host_result_t* result = nullptr;
    if (okid_host_stream_add(first, OKID_HOST_DOUBLE, record().data(), samples) == 0 &&
        okid_host_stream_state(first, &state, &bytes) == 0 && okid_host_stream_restore(second, state, bytes) == 0 &&
        okid_host_stream_merge(second, state, bytes) == 0 && okid_host_stream_identify(second, &result) == 0)
        modes = modes_in(result);
    else
        std::fprintf(stderr, "%s\n", okid_host_error());
    if (okid_host_stream_restore(second, state, bytes - 1) != 2 || okid_host_error()[0] == '\0') modes = 0;
    okid_host_stream_delete(first);
    okid_host_stream_delete(second);
    if (result && modes != modes_in(result)) modes = 0; // it stays when its stream is gone
    okid_host_result_delete(result);
    return modes;
}

/// Records by a call of their own, on threads of the library.
std::size_t own_record() {
    const double* data = record().data();
    const std::size_t count = samples;
    const char* name = "record";
    okid_host_result_t* result = nullptr;
    const std::string options = std::string(agreed).insert(1, "\"threads\": 2, \"sigma_blocks\": 0, ");
    const int32_t code = okid_host_identify(options.c_str(), 1, &data, &count, &name, nullptr, nullptr, &result);
    if (code != 0) std::fprintf(stderr, "%s\n", okid_host_error());
    const std::size_t modes = code == 0 ? modes_in(result) : 0;
    okid_host_result_delete(result);
    return modes;
}

/// What refuses says so to its own thread.
std::size_t own_errors(const std::string& name) {
    std::size_t right = 0;
    for (int k = 0; k < 50; ++k) {
        okid_host_stream_t* none = nullptr;
        okid_host_config_t* config = nullptr;
        const std::string options = R"({"inputs": [], "outputs": ["a"], "fs": 100, "method": ")" + name + "\"}";
        right += okid_host_stream_create(options.c_str(), nullptr, &none) == 2 && !none &&
                 std::strstr(okid_host_error(), name.c_str()) != nullptr;
        right += okid_host_config_load((name + ".toml").c_str(), ("[" + name + "]\n").c_str(), &config) == 2 &&
                 !config && std::strstr(okid_host_error(), name.c_str()) != nullptr;
        double factor = 0;
        const char* si = nullptr;
        right += okid_host_unit("g", &factor, &si) == 1 && factor > 9 && std::strcmp(si, "m/s^2") == 0;
    }
    return right;
}

void test_objects_of_their_own_at_the_same_time() {
    std::array<std::size_t, 6> found{};
    together({
        [&] { found[0] = own_stream(named); },
        [&] { found[1] = own_stream(agreed); },
        [&] { found[2] = own_record(); },
        [&] { found[3] = own_record(); },
        [&] { found[4] = own_errors("first"); },
        [&] { found[5] = own_errors("second"); },
    });
    for (const std::size_t k : {0u, 1u, 2u, 3u}) TEST_ASSERT_TRUE(found[k] >= 2);
    TEST_ASSERT_EQUAL_UINT(150, found[4]);
    TEST_ASSERT_EQUAL_UINT(150, found[5]);
}

} // namespace

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_one_object_is_fed_looked_at_and_closed);
    RUN_TEST(test_objects_of_their_own_at_the_same_time);
    return UNITY_END();
}
