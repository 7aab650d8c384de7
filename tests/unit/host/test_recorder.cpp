// SPDX-License-Identifier: MIT
// The recorder between its threads: two buses at once, the trigger, what nobody took.
#include "journal/recorder.hpp"

#include <cstdlib>
#include <filesystem>
#include <thread>
#include <unity.h>

using namespace okid_host;

namespace {

constexpr std::uint32_t per_bus = 30000;
constexpr std::int64_t begin_ns = 1700000000000000000, step_ns = 100000;

std::string folder;

live_config two_buses() {
    live_config config;
    config.path = folder + "/rig.toml";
    config.rate_hz = 1000;
    config.buses.resize(2);
    config.buses[0].name = "left";
    config.buses[1].name = "right";
    config.notes.emplace_back("title", "a rig: no. 7 / shaker");
    config.texts.config = "rate_hz = 1000\n";
    config.record.directory = folder + "/runs/deep";
    config.record.segment_mb = 0.4;
    return config;
}

drv_frame_t numbered(std::uint32_t number, std::uint8_t bus) {
    drv_frame_t frame{};
    frame.time_ns = begin_ns + step_ns * number;
    frame.id = number;
    frame.flags = DRV_FRAME_EXTENDED;
    frame.bus = bus;
    frame.len = 8;
    return frame;
}

void push(recorder& to, std::uint8_t bus, std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = first; i < first + count; ++i) {
        while (drv_ring_used(to.ring(bus)) > 60000) std::this_thread::yield();
        const drv_frame_t frame = numbered(i, bus);
        drv_ring_push(to.ring(bus), &frame, 1);
    }
}

/// The one recording of the folder: its first file.
std::string first_file() {
    std::string out;
    for (const auto& entry : std::filesystem::directory_iterator(folder + "/runs/deep"))
        if (entry.path().string().find("-0001.okj") != std::string::npos) out = entry.path().string();
    TEST_ASSERT_TRUE(!out.empty());
    return out;
}

/// Frames of each bus, in order and without a mark. @return the first number of each and how many there are
struct found {
    std::uint32_t first[2] = {0, 0}, count[2] = {0, 0};
};
found read_back(const std::string& path) {
    drv_source_t source{};
    source.ops = &drv_source_journal;
    drv_source_config_t config{};
    config.path = path.c_str();
    TEST_ASSERT_EQUAL_INT(0, source.ops->open(&source, &config));
    found out;
    drv_frame_t frame;
    while (source.ops->read(&source, &frame, 1) == 1) {
        TEST_ASSERT_TRUE(frame.bus < 2);
        if (out.count[frame.bus]++ == 0) out.first[frame.bus] = frame.id;
        TEST_ASSERT_EQUAL_UINT32(out.first[frame.bus] + out.count[frame.bus] - 1, frame.id);
        TEST_ASSERT_EQUAL_INT(0, frame.loss);
        TEST_ASSERT_EQUAL_INT64(begin_ns + step_ns * frame.id, frame.time_ns);
    }
    TEST_ASSERT_EQUAL_INT(1, drv_source_journal_reader(&source)->ended);
    source.ops->close(&source);
    return out;
}

void test_two_buses_at_once() {
    recorder both(two_buses(), {});
    both.start();
    std::thread left([&] { push(both, 0, 0, per_bus); }), right([&] { push(both, 1, 0, per_bus); });
    left.join();
    right.join();
    both.stop();
    TEST_ASSERT_FALSE(both.failed());
    TEST_ASSERT_EQUAL_UINT64(2 * per_bus, both.counts().frames);
    TEST_ASSERT_EQUAL_UINT64(0, both.counts().lost);
    TEST_ASSERT_TRUE(both.counts().segments > 2);
    const std::string path = first_file();
    TEST_ASSERT_TRUE(path.find("/a-rig-no-7-shaker-2") != std::string::npos);
    const found frames = read_back(path);
    TEST_ASSERT_EQUAL_UINT32(per_bus, frames.count[0]);
    TEST_ASSERT_EQUAL_UINT32(per_bus, frames.count[1]);
    const journal_header header = read_journal_header(path);
    TEST_ASSERT_EQUAL_STRING("rate_hz = 1000\n", header.texts.config.c_str());
    TEST_ASSERT_EQUAL_UINT64(2, header.buses.size());
    TEST_ASSERT_EQUAL_STRING("right", header.buses[1].name.c_str());
    const auto news = both.news();
    TEST_ASSERT_EQUAL_STRING("started", news.front().kind.c_str());
    TEST_ASSERT_EQUAL_STRING("finished", news.back().kind.c_str());
}

/// From pretrigger_s before the trigger on, whether frames wait in the ring or in the recorder when it is told.
void test_the_trigger() {
    live_config config = two_buses();
    config.trigger.source = trigger_source::level;
    config.record.pretrigger_s = 0.5;
    config.record.pretrigger_frames = 1 << 16;
    recorder waiting(config, {});
    waiting.start();
    push(waiting, 0, 0, 20000);
    while (drv_ring_used(waiting.ring(0)) > 0) std::this_thread::yield();
    TEST_ASSERT_TRUE(std::filesystem::is_empty(folder + "/runs/deep"));
    push(waiting, 1, 0, 20000);
    waiting.trigger(begin_ns + 15000 * step_ns);
    push(waiting, 0, 20000, 100);
    waiting.stop();
    const found frames = read_back(first_file());
    TEST_ASSERT_EQUAL_UINT32(10000, frames.first[0]);
    TEST_ASSERT_EQUAL_UINT32(10100, frames.count[0]);
    TEST_ASSERT_TRUE(read_journal_header(first_file()).trigger_ns == begin_ns + 15000 * step_ns);
}

/// More frames than were expected: the newest are kept, and it is said.
void test_more_frames_than_wait() {
    live_config config = two_buses();
    config.trigger.source = trigger_source::level;
    config.record.pretrigger_s = 10;
    config.record.pretrigger_frames = 1000;
    recorder waiting(config, {});
    waiting.start();
    push(waiting, 0, 0, 5000);
    while (drv_ring_used(waiting.ring(0)) > 0) std::this_thread::yield();
    waiting.trigger(begin_ns + 4900 * step_ns);
    waiting.stop();
    const found frames = read_back(first_file());
    TEST_ASSERT_EQUAL_UINT32(5000, frames.first[0] + frames.count[0]);
    TEST_ASSERT_EQUAL_UINT32(1000, frames.count[0]);
    bool said = false;
    for (const recording_news& one : waiting.news())
        said |= one.text.find("less than pretrigger_s is there") != std::string::npos;
    TEST_ASSERT_TRUE(said);
}

void test_nothing_came() {
    {
        recorder idle(two_buses(), {});
        idle.start();
        idle.stop();
        idle.stop();
    }
    TEST_ASSERT_EQUAL_UINT32(0, read_back(first_file()).count[0]);
}

} // namespace

void setUp(void) {
    char name[] = "/tmp/okid-recorder-XXXXXX";
    TEST_ASSERT_NOT_NULL(mkdtemp(name));
    folder = name;
}
void tearDown(void) { std::filesystem::remove_all(folder); }

int main() {
    UNITY_BEGIN();
    RUN_TEST(test_two_buses_at_once);
    RUN_TEST(test_the_trigger);
    RUN_TEST(test_more_frames_than_wait);
    RUN_TEST(test_nothing_came);
    return UNITY_END();
}
