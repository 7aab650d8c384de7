// SPDX-License-Identifier: MIT
// The CSV reader: dialects, missing samples, sample rate, and a clear refusal of everything else.
#include "error.hpp"
#include "files/nearest_name.hpp"
#include "record/csv.hpp"
#include "record/csv_header.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <unistd.h>
#include <unity.h> // last: old versions define macros over <cmath>

using okid_host::csv_record;
using okid_host::csv_request;

namespace {

std::string path;

bool missing(double x) { return x != x; }

void put(const std::string& text) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL_UINT64(text.size(), std::fwrite(text.data(), 1, text.size(), file));
    std::fclose(file);
}

csv_record take(const std::string& text, std::vector<std::string> columns = {"a", "b"}) {
    put(text);
    csv_request request;
    request.columns = std::move(columns);
    return okid_host::read_csv(path, request);
}

/// The text is refused with exit code 2 and a message that holds `part`.
void refused(const std::string& text, const std::string& part, std::vector<std::string> columns = {"a", "b"}) {
    std::string message;
    try {
        take(text, std::move(columns));
    } catch (const okid_host::failure& error) {
        TEST_ASSERT_EQUAL_INT(okid_host::exit_usage, error.code);
        message = error.what();
    }
    if (message.find(part) == std::string::npos || message.find(path) == std::string::npos)
        TEST_FAIL_MESSAGE(("expected \"" + part + "\" in \"" + message + "\"").c_str());
}

void plain_numbers() {
    const csv_record r = take("# fs_hz: 100\na,skip,b\n1,x y,-2.5e-3\n+4,\"q,\"\"q\",.5\n");
    TEST_ASSERT_EQUAL_UINT64(2, r.count);
    TEST_ASSERT_EQUAL_DOUBLE(100, r.fs_hz);
    const double expected[] = {1, -2.5e-3, 4, 0.5};
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(expected, r.samples.data(), 4);
    TEST_ASSERT_EQUAL_UINT64(3, r.first_line);
}

void order_of_the_columns_asked_for() {
    const csv_record r = take("# fs_hz=2\na,b\n1,2\n", {"b", "a"});
    TEST_ASSERT_EQUAL_DOUBLE(2, r.samples[0]);
    TEST_ASSERT_EQUAL_DOUBLE(1, r.samples[1]);
}

void numbers_are_read_to_the_last_bit() {
    const csv_record r =
        take("# fs_hz=2\na,b\n0.1,1.7976931348623157e308\n4.9e-324,1e-400\n123456789012345678901,-0\n");
    TEST_ASSERT_TRUE(r.samples[0] == 0.1);
    TEST_ASSERT_TRUE(r.samples[1] == 1.7976931348623157e308);
    TEST_ASSERT_TRUE(r.samples[2] == 4.9e-324);
    TEST_ASSERT_TRUE(r.samples[3] == 0);
    TEST_ASSERT_TRUE(r.samples[4] == 123456789012345678901.0);
}

/// Whatever way a number takes, it is that of strtod(): with a point, and with a decimal comma between semicolons.
void numbers_are_those_of_strtod() {
    std::string points = "# fs_hz: 1\na,b\n", commas = "# fs_hz: 1\na;b\n";
    std::vector<double> expected;
    std::uint64_t state = 1;
    const auto random = [&] { return (state = state * 6364136223846793005u + 1442695040888963407u) >> 11; };
    const char* const formats[] = {"%.17g", "%.6f", "%.0f", "%.18e", "%.3f", "%.12g", "-%.15f", "%.9f"};
    for (int n = 0; n < 40000; ++n) {
        char text[64];
        const double value = static_cast<double>(random()) / std::pow(10.0, static_cast<double>(random() % 20));
        std::snprintf(text, sizeof text, formats[random() % 8], value);
        expected.push_back(std::strtod(text, nullptr));
        points += text;
        points += n % 2 ? '\n' : ',';
        std::replace(text, text + std::strlen(text), '.', ',');
        commas += text;
        commas += n % 2 ? '\n' : ';';
    }
    for (const std::string& text : {points, commas}) {
        const csv_record r = take(text);
        TEST_ASSERT_EQUAL_UINT64(expected.size(), r.samples.size());
        TEST_ASSERT_EQUAL_MEMORY(expected.data(), r.samples.data(), expected.size() * sizeof(double));
    }
}

/// Pieces are read side by side: what is told is the first fault of the file, with its line.
void the_first_fault_of_a_large_file() {
    constexpr std::size_t rows = 1200000; // 10 MB
    std::string good = "# fs_hz: 1\na,b\n";
    const std::size_t head = good.size();
    for (std::size_t n = 0; n < rows; ++n) good += "1.5,2.25\n";
    const auto at = [&](std::size_t line) { return head + (line - 3) * 9; };
    const csv_record r = take(good + "\n \n");
    TEST_ASSERT_EQUAL_UINT64(rows, r.count);
    TEST_ASSERT_EQUAL_DOUBLE(2.25, r.samples.back());
    TEST_ASSERT_EQUAL_UINT64(2 * rows, r.samples.size());
    std::string bad = good;
    bad.replace(at(900000), 3, "inf");
    bad.replace(at(700001) + 4, 4, "text");
    refused(bad, "line 700001, column 2 (b): found \"text\"");
    bad.replace(at(650000), 8, "        ");
    refused(bad, "line 650000: an empty line between rows");
    refused(good.substr(0, at(600000)) + "\n" + good.substr(head), "line 600000: an empty line between rows");
    refused(good.substr(0, at(900001)) + "1,2,3\n" + good.substr(head), "line 900001: found 3 cells");
    std::replace(good.begin(), good.end(), ',', ';');
    good.replace(at(800000), 3, "1,5");
    refused(good, "line 800000, column 1 (a): found \"1,5\", expected one decimal mark");
}

void windows_export() {
    const csv_record r = take("\xEF\xBB\xBF# fs_hz: 512\r\n\"a\";\"b\"\r\n1,5;-0,25\r\n2;3,0e2\r\n");
    const double expected[] = {1.5, -0.25, 2, 300};
    TEST_ASSERT_EQUAL_DOUBLE_ARRAY(expected, r.samples.data(), 4);
}

void tab_and_blanks() {
    const csv_record r = take("# fs_hz: 1\n a \tb\n 1 \t2\n\t\n3\t\n");
    TEST_ASSERT_EQUAL_UINT64(3, r.count);
    TEST_ASSERT_TRUE(missing(r.samples[2]) && missing(r.samples[3]) && missing(r.samples[5]));
}

void missing_cells() {
    const csv_record r = take("# fs_hz: 1\na,b\nnan,1\n,NaN\n-nan,2\n5, \n");
    TEST_ASSERT_EQUAL_UINT64(4, r.count);
    TEST_ASSERT_TRUE(missing(r.samples[0]) && missing(r.samples[2]) && missing(r.samples[3]));
    TEST_ASSERT_TRUE(missing(r.samples[4]) && missing(r.samples[7]));
    TEST_ASSERT_EQUAL_DOUBLE(5, r.samples[6]);
}

void ends_of_the_file() {
    TEST_ASSERT_EQUAL_UINT64(1, take("# fs_hz: 1\na,b\n1,2").count);
    TEST_ASSERT_EQUAL_UINT64(1, take("# fs_hz: 1\na,b\n1,2\n\n\n").count);
    TEST_ASSERT_EQUAL_UINT64(1, take("\n# fs_hz: 1\n\na,b\n1,2\r\n").count);
}

void a_file_larger_than_a_piece() {
    std::string text = "# fs_hz: 1\na,b\n";
    const std::size_t rows = 700000; // > 8 MiB
    for (std::size_t i = 0; i < rows; ++i) text += std::to_string(i) + ",0.25\n";
    const csv_record r = take(text);
    TEST_ASSERT_EQUAL_UINT64(rows, r.count);
    for (std::size_t i = 0; i < rows; ++i)
        if (r.samples[2 * i] != static_cast<double>(i) || r.samples[2 * i + 1] != 0.25)
            TEST_FAIL_MESSAGE("a row was misread");
}

void a_long_line() {
    const std::string comment = "# " + std::string(std::size_t{6} << 20, 'x') + "\n";
    TEST_ASSERT_EQUAL_UINT64(1, take(comment + "# fs_hz: 1\na,b\n1,2\n").count);
    refused("# fs_hz: 1\na,b\n1," + std::string(std::size_t{65} << 20, '1'), "64 MiB");
}

void rate_lines() {
    TEST_ASSERT_EQUAL_DOUBLE(1024, take("# x; sample_rate_hz=1024 ; units\na,b\n1,2\n").fs_hz);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, take("#FS_HZ = .5\na,b\n1,2\n").fs_hz);
    TEST_ASSERT_EQUAL_DOUBLE(50, take("# old_fs_hz: 7\n# fs_hz : 5e1\na,b\n1,2\n").fs_hz);
    refused("# fs_hz: unknown\na,b\n1,2\n", "unknown");
    refused("# fs_hz: nan\na,b\n1,2\n", "no sample rate");
    refused("# fs_hz: inf\na,b\n1,2\n", "no sample rate");
    refused("# fs_hz\na,b\n1,2\n", "no sample rate");
    refused("# fs_hz: -3\na,b\n1,2\n", "above 0");
    refused("# fs_hz: 512,5\na,b\n1,2\n", "ambiguous");
}

void time_column() {
    TEST_ASSERT_EQUAL_DOUBLE(1000, take("time_s,a,b\n5.000,1,2\n5.001,3,4\n5.002,5,6\n").fs_hz);
    const csv_record r = take("time_s,b\n0,2\n0.5,4\n", {"time_s", "b"});
    TEST_ASSERT_EQUAL_DOUBLE(2, r.fs_hz);
    TEST_ASSERT_EQUAL_DOUBLE(0.5, r.samples[2]);
    refused("time_s,a,b\n0,1,2\n0.1,3,4\n0.3,5,6\n", "line 3");
    refused("time_s,a,b\n0,1,2\n,3,4\n", "time stamp");
    refused("time_s,a,b\n1,1,2\n1,3,4\n", "line 3");
    refused("time_s,a,b\n2,1,2\n1,3,4\n", "step of -1");
    refused("time_s,a,b\n2,1,2\n", "one row");
}

/// Rows `at` of a record at `fs`, their stamps with so many decimals. @param first  of the stamps, s
std::string stamped(const char* name, double fs, int decimals, int rows, int left_out = -1, double first = 0) {
    std::string text = std::string(name) + ",a,b\n";
    char line[64];
    for (int i = 0; i < rows; ++i) {
        if (i == left_out) continue;
        std::snprintf(line, sizeof line, "%.*f,%d,%d\n", decimals, first + i / fs, i % 7, i % 5);
        text += line;
    }
    return text;
}

void names_of_a_time() {
    for (const char* name : {"time_s", "Time [s]", "t (s)", "time", "Time", "t", "T", "t_s"})
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(250, take(stamped(name, 250, 4, 99)).fs_hz, name);
    TEST_ASSERT_EQUAL_DOUBLE(4, take("t,time_s,b\n21.5,0,2\n21.6,.25,3\n21.9,.5,4\n", {"b"}).fs_hz);
    refused("t,b\n0.1,2\n0.2,3\n", "no sample rate", {"t", "b"}); // a channel: torque, temperature
    refused("Time,a,b\n0,1,2\n1,3,4\n2,5,6\n", "whole numbers without a unit");
    TEST_ASSERT_EQUAL_DOUBLE(1, take("time_s,a,b\n0,1,2\n1,3,4\n2,5,6\n").fs_hz);
    refused("Time [ms],a,b\n0,1,2\n1,3,4\n", "is not in seconds");
}

void rounded_stamps() {
    for (const double fs : {1024.0, 1000.0, 800.0, 512.0, 333.25, 1707.0})
        for (const double first : {0.0, 1764402555.123})
            TEST_ASSERT_DOUBLE_WITHIN(1e-7 * fs, fs, take(stamped("time_s", fs, 3, 20000, -1, first)).fs_hz);
    for (const int row : {40, 150, 299}) refused(stamped("time_s", 1024, 3, 400, row), "missing");
    refused(stamped("time_s", 1024, 3, 90), "evenly spaced"); // too few to tell
    refused(stamped("time_s", 100, 2, 600, 300), "missing");  // as 99.83 Hz would be, rounded
    for (const double fs : {1000.0, 100.0}) { // a search for the rate must end where doubles tell none apart
        std::string jitter = "time_s,a,b\n";
        for (int i = 0; i < 6000; ++i) jitter += std::to_string((i + 0.3 * (i * i % 17 / 17.0)) / fs) + ",1,2\n";
        refused(jitter, "evenly spaced");
    }
}

void refusals() {
    refused("", "empty");
    refused("\n\n", "no line of column names");
    refused("# fs_hz: 1\na,b\n", "no rows");
    refused("# fs_hz: 1\na,b\n1,2\n1\n", "line 4: found 1 cell, expected 2");
    refused("# fs_hz: 1\na,b\n1,2,\n", "line 3: found 3 cells, expected 2");
    refused("# fs_hz: 1\na,b\n1,zwei\n", "line 3, column 2 (b): found \"zwei\", expected a number");
    refused("# fs_hz: 1\na,b\n1,inf\n", "finite");
    refused("# fs_hz: 1\na,b\n1,-1e309\n", "finite");
    refused("# fs_hz: 1\na,b\n,1\nnan,1\n", "column \"a\" holds no number");
    refused("# fs_hz: 1\na,a,b\n1,2,3\n", "column 2: the name \"a\" stands twice");
    refused("# fs_hz: 1\na,c\n1,2\n", "no column \"b\"");
    refused("# fs_hz: 1\na;b\n1,5;2.5\n", "one decimal mark");
    refused("# fs_hz: 1\na;b\n1.234,5;2\n", "a number");
    refused("# fs_hz: 1\na;b\n1,2,3;2\n", "a number");
    refused("# fs_hz: 1\na,b\n1,2\n# more\n", "line 4");
    refused("# fs_hz: 1\na,b\n1,2\n\n1,2\n", "line 4: an empty line");
    refused(std::string("# fs_hz: 1\na,b\n1,\x01\n"), "found \"?\"");
    refused(std::string("a\0b", 3), "not a text file");
    refused("# fs_hz: 1\na\x02,b\n1,2\n", "not a text file");
    refused("# fs_hz: 1\na [g],b\n1,2\n", "same column", {"a", "a [g]"});
}

void files_that_cannot_be_opened() {
    for (const std::string& bad : {std::string("/nonexistent/x.csv"), std::string("/"), std::string()}) {
        csv_request request;
        request.columns = {"a"};
        try {
            okid_host::read_csv(bad, request);
            TEST_FAIL_MESSAGE("was read");
        } catch (const okid_host::failure& error) {
            TEST_ASSERT_EQUAL_INT(okid_host::exit_usage, error.code);
        }
    }
}

void units_and_names() {
    TEST_ASSERT_EQUAL_STRING("g", okid_host::unit_of_name("acc1 [g]").c_str());
    TEST_ASSERT_EQUAL_STRING("m/s^2", okid_host::unit_of_name("acc1 (m/s^2)").c_str());
    TEST_ASSERT_EQUAL_STRING("g", okid_host::unit_of_name("acc1_g").c_str());
    TEST_ASSERT_EQUAL_STRING("", okid_host::unit_of_name("u1_force").c_str());
    TEST_ASSERT_EQUAL_STRING("", okid_host::unit_of_name("y").c_str());
    const csv_record r = take("# fs_hz: 1\nacc [g],f_N\n1,2\n", {"acc", "f_N"});
    TEST_ASSERT_EQUAL_STRING("g", r.units[0].c_str());
    TEST_ASSERT_EQUAL_STRING("N", r.units[1].c_str());
    const auto names = okid_host::split_names("--inputs", "a, \"b,c\" ,\"d\"\"e\"");
    TEST_ASSERT_EQUAL_UINT64(3, names.size());
    TEST_ASSERT_EQUAL_STRING("b,c", names[1].c_str());
    TEST_ASSERT_EQUAL_STRING("d\"e", names[2].c_str());
}

void nearest_names() {
    TEST_ASSERT_EQUAL_STRING("rate_hz", okid_host::nearest_name("rate_Hz", {"seed", "rate_hz"}).c_str());
    TEST_ASSERT_EQUAL_STRING("noise_percent", okid_host::nearest_name("noise", {"bits", "noise_percent"}).c_str());
    TEST_ASSERT_EQUAL_STRING("", okid_host::nearest_name("banana", {"seed", "rate_hz"}).c_str());
    TEST_ASSERT_EQUAL_STRING("äö…", okid_host::printable("äöüß", 5).c_str());
    TEST_ASSERT_EQUAL_STRING("a?b", okid_host::printable("a\nb").c_str());
}

} // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
    char name[] = "/tmp/okid_csv_XXXXXX";
    const int fd = mkstemp(name);
    if (fd < 0) return 1;
    close(fd);
    path = name;
    UNITY_BEGIN();
    RUN_TEST(plain_numbers);
    RUN_TEST(order_of_the_columns_asked_for);
    RUN_TEST(numbers_are_read_to_the_last_bit);
    RUN_TEST(numbers_are_those_of_strtod);
    RUN_TEST(the_first_fault_of_a_large_file);
    RUN_TEST(windows_export);
    RUN_TEST(tab_and_blanks);
    RUN_TEST(missing_cells);
    RUN_TEST(ends_of_the_file);
    RUN_TEST(a_file_larger_than_a_piece);
    RUN_TEST(a_long_line);
    RUN_TEST(rate_lines);
    RUN_TEST(time_column);
    RUN_TEST(names_of_a_time);
    RUN_TEST(rounded_stamps);
    RUN_TEST(refusals);
    RUN_TEST(files_that_cannot_be_opened);
    RUN_TEST(units_and_names);
    RUN_TEST(nearest_names);
    const int failed = UNITY_END();
    std::remove(path.c_str());
    return failed;
}
