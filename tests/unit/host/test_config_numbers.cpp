// SPDX-License-Identifier: MIT
// Every numeric key of a CONFIG.toml at its documented ends and beyond, alone and beside another one: taken, or refused with
// exit 2 and one line. Release 0.2 ended by a signal where what is refused is a default that no line of the file holds.
#include "config/config.hpp"
#include "config_numbers.hpp"
#include "error.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <unity.h>

using namespace okid_host;

namespace {

std::string path;

/// "" = taken, else what it says.
std::string told(const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
    try {
        const live_config config = load_config(path);
        TEST_ASSERT_TRUE_MESSAGE(config.rate_hz > 0 && config.identification.update_s > 0, text.c_str());
    } catch (const failure& error) {
        TEST_ASSERT_EQUAL_INT_MESSAGE(exit_usage, error.code, text.c_str());
        const std::string said = error.what();
        TEST_ASSERT_TRUE_MESSAGE(!said.empty() && said.find('\n') == std::string::npos, text.c_str());
        return said;
    }
    return "";
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

static void test_every_number_at_its_ends() {
    for (const number_key& key : number_keys())
        for (std::size_t choice = 0; choice < okid_test::number_values; ++choice) {
            const std::string value = okid_test::number_text(key, choice);
            for (const char* method : {"", "method = \"okid-era\"\nwindow_s = 10\n", "sigma_blocks = 0\n"})
                told(okid_test::config_with_number(key, value, method));
        }
}

static void test_slow_grids_are_taken() {
    for (const char* rate : {"0.00001", "0.0001", "0.5", "1000000.0"}) {
        const number_key key{"acquisition", "rate_hz", false, 0, 1};
        TEST_ASSERT_EQUAL_STRING("", told(okid_test::config_with_number(key, rate)).c_str());
    }
}

static void test_a_key_that_is_not_there_has_no_place() {
    const number_key key{"acquisition", "rate_hz", false, 0, 1};
    const std::string said =
        told(okid_test::config_with_number(key, "0.00001") + "[identification]\nmethod = \"okid-era\"\nupdate_s = 1\n");
    TEST_ASSERT_TRUE_MESSAGE(said.find("line 20, [identification], key \"update_s\"") != std::string::npos,
                             said.c_str());
    const std::string more =
        told(okid_test::config_with_number(key, "100.0") + "[record]\nsegment_mb = 1e6\nmax_mb = 1\n");
    TEST_ASSERT_TRUE_MESSAGE(more.find("\"max_mb\": found 1") != std::string::npos, more.c_str());
}

int main(void) {
    char folder[] = "/tmp/okid-numbers-XXXXXX";
    if (!mkdtemp(folder)) return 1;
    path = std::string(folder) + "/c.toml";
    UNITY_BEGIN();
    RUN_TEST(test_every_number_at_its_ends);
    RUN_TEST(test_slow_grids_are_taken);
    RUN_TEST(test_a_key_that_is_not_there_has_no_place);
    const int bad = UNITY_END();
    std::filesystem::remove_all(folder);
    return bad;
}
