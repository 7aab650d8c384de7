// SPDX-License-Identifier: MIT
// Every wrong CONFIG.toml ends with exit 2 and a message that names line, key, what was found and what was expected.
#include "config/config.hpp"
#include "error.hpp"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <unity.h>

using namespace okid_host;

namespace {

std::filesystem::path room;

const std::string good = R"([acquisition]
rate_hz = 1000
title = "test"
[[bus]]
name = "can0"
interface = "vcan0"
dbc = "okid.dbc"
[[channel]]
name = "a1"
role = "acceleration"
message = "OKID_Accel1"
signal = "Accel1"
[[channel]]
name = "f1"
role = "force"
message = "OKID_Force"
signal = "Force1"
sequence = "Counter"
[[channel]]
name = "raw"
role = "aux"
can_id = 0x18FF0001
start_bit = 7
length = 12
byte_order = "big"
signed = true
scale = 0.5
offset = -1
sequence = { start_bit = 16, length = 8 }
[identification]
p = 20
order = "auto"
window_s = 10
)";

live_config load(const std::string& text) {
    const std::string path = (room / "c.toml").string();
    std::ofstream(path, std::ios::binary) << text;
    return load_config(path);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    TEST_ASSERT_TRUE_MESSAGE(at != std::string::npos, from.c_str());
    return text.replace(at, from.size(), to);
}

/// The config must be refused with exit 2 and all these words.
void refuse(const std::string& text, std::initializer_list<const char*> words) {
    try {
        const live_config config = load(text);
        require_identifiable(config);
    } catch (const failure& error) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(exit_usage, error.code, error.what());
        for (const char* word : words) {
            const std::string message = std::string("\"") + word + "\" is not in: " + error.what();
            TEST_ASSERT_TRUE_MESSAGE(std::string(error.what()).find(word) != std::string::npos, message.c_str());
        }
        return;
    }
    TEST_FAIL_MESSAGE(text.c_str());
}

void refuse_change(const char* from, const std::string& to, std::initializer_list<const char*> words) {
    refuse(replaced(good, from, to), words);
}

} // namespace

void setUp(void) {
    char pattern[] = "/tmp/okid-config-XXXXXX";
    room = mkdtemp(pattern);
    std::filesystem::copy_file(OKID_SOURCE_DIR "/drivers/proto/okid.dbc", room / "okid.dbc");
}
void tearDown(void) { std::filesystem::remove_all(room); }

static void test_good() {
    const live_config config = load(good);
    TEST_ASSERT_EQUAL_INT(3, config.channels.size());
    TEST_ASSERT_EQUAL_STRING("f1", config.channels[0].name.c_str()); // inputs, outputs, aux
    TEST_ASSERT_EQUAL_STRING("a1", config.channels[1].name.c_str());
    TEST_ASSERT_EQUAL_INT(1, config.n_u);
    TEST_ASSERT_EQUAL_INT(1, config.n_y);
    TEST_ASSERT_EQUAL_HEX32(0x100, config.channels[0].frame.id);
    TEST_ASSERT_EQUAL_DOUBLE(0.01, config.channels[0].layout.scale);
    TEST_ASSERT_EQUAL_STRING("N", config.channels[0].unit.c_str());
    TEST_ASSERT_TRUE(config.channels[0].sequence.has_value());
    TEST_ASSERT_FALSE(config.channels[1].sequence.has_value());
    const channel_config& raw = config.channels[2];
    TEST_ASSERT_EQUAL_INT(1, raw.frame.extended);
    TEST_ASSERT_EQUAL_INT(1, raw.layout.big_endian);
    TEST_ASSERT_EQUAL_DOUBLE(-1, raw.layout.offset);
    TEST_ASSERT_EQUAL_INT(8, raw.sequence->length);
    TEST_ASSERT_EQUAL_DOUBLE(10, *config.identification.window_s);
    TEST_ASSERT_EQUAL_INT(3, wanted_frames(config, 0).size());
}

static void test_byte_order_mark_and_line_ends() {
    std::string text = "\xEF\xBB\xBF";
    for (const char c : good) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
    TEST_ASSERT_EQUAL_INT(3, load(text).channels.size());
}

static void test_unknown_keys() {
    refuse_change("rate_hz", "rate_hzz",
                  {"line 2", "[acquisition]", "\"rate_hzz\": unknown key", "did you mean \"rate_hz\"?"});
    refuse_change("[identification]", "[identifcation]", {"unknown section", "did you mean \"identification\"?"});
    refuse_change("title =", "windows_s =", {"line 3", "windows_s", "known here: rate_hz"});
    refuse_change("interface =", "interfase =", {"line 6", "[[bus]] \"can0\"", "did you mean \"interface\"?"});
    refuse_change("role = \"aux\"", "role = \"aux\"\nsgined = true",
                  {"[[channel]] \"raw\"", "did you mean \"signed\"?"});
    refuse("rate = 3\n" + good, {"line 1", "top level", "unknown key"});
    refuse_change("length = 8 }", "length = 8, lenght = 2 }", {"unknown \"lenght\"", "start_bit, length, byte_order"});
}

static void test_wrong_types_and_ranges() {
    refuse_change("rate_hz = 1000", "rate_hz = \"1000\"", {"line 2", "found \"1000\", expected a number from 1e-05"});
    refuse_change("rate_hz = 1000", "rate_hz = 0", {"found 0"});
    refuse_change("rate_hz = 1000", "rate_hz = nan", {"line 2", "rate_hz"});
    refuse_change("rate_hz = 1000", "", {"\"rate_hz\" is missing"});
    refuse_change("p = 20", "p = 2.5", {"found 2.5, expected a whole number from 1 to 4096"});
    refuse_change("p = 20", "p = 0", {"found 0"});
    refuse_change("order = \"auto\"", "order = \"best\"", {"found \"best\"", "\"auto\""});
    refuse_change("order = \"auto\"", "order = -2", {"found -2"});
    refuse_change("signed = true", "signed = 1", {"found 1, expected true or false"});
    refuse_change("length = 12", "length = 65", {"found 65", "from 1 to 64"});
    refuse_change("role = \"force\"", "role = \"forse\"", {"found \"forse\"", "did you mean \"force\"?"});
    refuse_change("window_s = 10", "window_s = 0.01", {"window_s", "unknowns (p 20)"});
    refuse_change("window_s = 10", "window_s = 0.01\nmethod = \"n4sid-moesp\"", {"window_s", "unknowns (rows 30)"});
    refuse_change("window_s = 10", "update_s = 0.0001", {"update_s", "at least one sample"});
    refuse_change("[[bus]]", "[bus]", {"expected sections [[bus]]"});
    refuse_change("[identification]", "[[identification]]", {"expected a section [identification]"});
}

static void test_not_available() {
    refuse_change("p = 20", "method = \"n4sid-cvo\"", {"method", "did you mean \"n4sid-cva\"?"});
    refuse_change("p = 20", "forgetting = 0.999", {"forgetting", "window_s", "choose one"});
    refuse_change("p = 20", "detrend = \"linear\"", {"detrend", "linear"});
    refuse_change("window_s = 10", "window = \"auto\"", {"window", "needs window_s, the longest window"});
    refuse_change("window_s = 10", "window_s = 10\nwindow = \"auto\"\nmethod = \"auto\"",
                  {"window", "expected a method such as \"okid-era\""});
    refuse_change("window_s = 10", "window_s = 10\nwindow = \"auto\"\nsigma = \"none\"",
                  {"window", "expected sigma_blocks above 0"});
    refuse_change("window_s = 10", "window_s = 10\nwindow = \"auto\"\nrefine = \"yes\"",
                  {"window", "refine exclude each other"});
    refuse_change("interface = \"vcan0\"", "type = \"serial\"\ndevice = \"/dev/ttyUSB0\"",
                  {"dbc", "found on a bus of type serial", "the channels of a serial bus have a field"});
    refuse_change("interface = \"vcan0\"", "type = \"usb\"",
                  {"type", "expected one of: socketcan, slcan, serial, replay"});
}

static void test_channels() {
    refuse_change("\"OKID_Force\"", "\"OKID_Forse\"",
                  {"line 16", "[[channel]] \"f1\"", "did you mean \"OKID_Force\"?"});
    refuse_change("\"Force1\"", "\"Force9\"", {"line 17", "found \"Force9\"", "OKID_Force"});
    refuse_change("\"Counter\"", "\"Count\"", {"sequence", "did you mean \"Counter\"?"});
    refuse_change("\"Counter\"", "\"Force2\"", {"sequence", "unsigned"});
    refuse_change("name = \"f1\"", "name = \"a1\"", {"another [[channel]] has this name"});
    refuse_change("signal = \"Force1\"", "", {"[[channel]] \"f1\"", "\"signal\" is missing"});
    refuse_change("signal = \"Force1\"", "signal = \"Force1\"\nlength = 3", {"length", "not both"});
    refuse_change("length = 12", "", {"\"length\" is missing"});
    refuse_change("start_bit = 7", "start_bit = 510", {"start_bit", "byte 64"});
    refuse_change("scale = 0.5", "scale = 0", {"scale", "found 0"});
    refuse_change("role = \"force\"", "role = \"force\"\nbus = \"can1\"", {"bus", "found \"can1\"", "can0"});
    refuse_change("role = \"acceleration\"", "role = \"aux\"", {"at least one response"});
    refuse_change("dbc = \"okid.dbc\"", "", {"message", "has no dbc"});
    refuse_change("dbc = \"okid.dbc\"", "dbc = \"none.dbc\"", {"none.dbc", "cannot be read"});
}

static void test_syntax_and_files() {
    refuse_change("rate_hz = 1000", "rate_hz = = 1000", {"c.toml", "line 2, column"});
    refuse("", {"c.toml"});
    refuse(std::string("\x00\x01\xff", 3), {"c.toml"});
    try {
        load_config("/nonexistent.toml");
        TEST_FAIL();
    } catch (const failure& error) {
        TEST_ASSERT_EQUAL_INT(exit_usage, error.code);
    }
}

static void test_a_geometry_is_taken_in_silence() {
    const live_config config =
        load(good + "[geometry]\nnodes = [[0, 0, 0]]\ndofs = [[1, \"x\"], [1, \"+y\"], [1, \"-z\"]]\n");
    TEST_ASSERT_EQUAL_INT(0, config.warnings.size());
}

static void test_an_adapter_in_place_of_an_interface() {
    live_config config = load(replaced(good, "interface = \"vcan0\"", "adapter = \"1-1.4\"\nadapter_channel = 1"));
    TEST_ASSERT_EQUAL_STRING("1-1.4", config.buses[0].adapter.c_str());
    TEST_ASSERT_EQUAL_INT(1, config.buses[0].adapter_channel);
    TEST_ASSERT_EQUAL_STRING("can0", config.buses[0].interface.c_str()); // in logs
    refuse_change("interface = \"vcan0\"", "", {"\"interface\" is missing", "adapter = "});
    refuse_change("interface = \"vcan0\"", "interface = \"vcan0\"\nadapter = \"0042\"",
                  {"line 6", "\"interface\"", "one of the two"});
    refuse_change("interface = \"vcan0\"", "interface = \"vcan0\"\nadapter_channel = 1",
                  {"line 7", "\"adapter_channel\"", "needs adapter"});
    refuse_change("interface = \"vcan0\"", "adapter = \"\"", {"line 6", "\"adapter\"", "expected text"});
    refuse_change("interface = \"vcan0\"", "adapter = \"" + std::string(128, '4') + "\"",
                  {"line 6", "\"adapter\"", "at most 127"});
    refuse_change("interface = \"vcan0\"", "type = \"slcan\"\ndevice = \"/dev/ttyACM0\"\nadapter = \"0042\"",
                  {"\"adapter\"", "on a bus of type slcan"});
    const char* second = "[[bus]]\nname = \"two\"\nadapter = \"0042\"\n[[channel]]";
    const std::string one = replaced(good, "interface = \"vcan0\"", "adapter = \"0042\"");
    refuse(replaced(one, "[[channel]]", second), {"\"adapter\"", "bus \"can0\" uses this channel of it already"});
}

static void test_alarm() {
    TEST_ASSERT_TRUE(load(good).alarm.enabled);
    const live_config config = load(good + "[alarm]\nk_sigma = 4\nbaseline_updates = 7\ncommand = \"hook\"\n");
    TEST_ASSERT_EQUAL_DOUBLE(4, config.alarm.k_sigma);
    TEST_ASSERT_EQUAL_INT(7, config.alarm.baseline_updates);
    TEST_ASSERT_EQUAL_STRING((room / "hook").c_str(), config.alarm.command.c_str());
    TEST_ASSERT_EQUAL_INT(1, config.warnings.size()); // it is not there
    refuse(good + "[alarm]\nk_sigma = -1\n", {"[alarm]", "found -1"});
    TEST_ASSERT_FALSE(load(good + "[alarm]\nenabled = false\n").alarm.enabled);
    const std::string blind = good + "sigma_blocks = 0\n";
    TEST_ASSERT_FALSE(load(blind).alarm.enabled);
    refuse(blind + "[alarm]\nenabled = true\n", {"[alarm]", "sigma_blocks = 0 computes none"});
    const std::string lamp = "[lamps]\nalarm = { chip = \"gpiochip0\", line = 1 }\n";
    TEST_ASSERT_EQUAL_INT(0, load(good + lamp).warnings.size());
    TEST_ASSERT_EQUAL_INT(1, load(blind + lamp).warnings.size());
}

static void test_publish() {
    const auto publish = [](const std::string& text) { return load(good + "[publish]\n" + text).publish; };
    TEST_ASSERT_EQUAL_STRING("127.0.0.1:9870", publish("udp = \"9870\"").udp->text().c_str());
    TEST_ASSERT_EQUAL_STRING("127.0.0.1:9870", publish("udp = \":9870\"").udp->text().c_str());
    TEST_ASSERT_EQUAL_STRING("[::1]:9870", publish("udp = \"[::1]:9870\"").udp->text().c_str());
    TEST_ASSERT_TRUE(publish("udp = \"[::1]:9870\"").udp->loopback());
    TEST_ASSERT_FALSE(publish("udp = \"10.0.0.1:9870\"").udp->loopback());
    TEST_ASSERT_EQUAL_STRING((room / "live.sock").c_str(), publish("socket = \"live.sock\"").socket.c_str());
    TEST_ASSERT_EQUAL_INT(0, load(good + "[publish]\nudp = \"9870\"").warnings.size());
    TEST_ASSERT_EQUAL_INT(1, load(good + "[publish]\nudp = \"10.0.0.1:9870\"").warnings.size());
    refuse(good + "[publish]\nudb = \"x\"\n", {"did you mean \"udp\"?"});
    for (const char* wrong : {"", "host", "host:0", "host:65536", "host:12x", "[::1:9870", "[::1]9870", "a b:9870"})
        refuse(good + "[publish]\nudp = \"" + wrong + "\"\n", {"\"udp\""});
#ifdef OKID_MQTT
    const broker_address broker = *publish("mqtt = \"mqtt://me:secret@broker:1884/a/b/\"").mqtt;
    TEST_ASSERT_EQUAL_STRING("broker:1884", broker.at.text().c_str());
    TEST_ASSERT_EQUAL_STRING("me secret a/b", (broker.user + " " + broker.password + " " + broker.prefix).c_str());
    TEST_ASSERT_EQUAL_INT(1883, publish("mqtt = \"mqtt://localhost\"").mqtt->at.port);
    TEST_ASSERT_EQUAL_STRING("okid", publish("mqtt = \"mqtt://localhost/\"").mqtt->prefix.c_str());
#else
    refuse(good + "[publish]\nmqtt = \"mqtt://localhost\"\n", {"built without", "libmosquitto-dev"});
#endif
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_good);
    RUN_TEST(test_byte_order_mark_and_line_ends);
    RUN_TEST(test_unknown_keys);
    RUN_TEST(test_wrong_types_and_ranges);
    RUN_TEST(test_not_available);
    RUN_TEST(test_channels);
    RUN_TEST(test_syntax_and_files);
    RUN_TEST(test_a_geometry_is_taken_in_silence);
    RUN_TEST(test_an_adapter_in_place_of_an_interface);
    RUN_TEST(test_alarm);
    RUN_TEST(test_publish);
    return UNITY_END();
}
