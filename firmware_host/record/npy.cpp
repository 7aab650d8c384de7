// SPDX-License-Identifier: MIT
// PURPOSE  a .npy file into a record
// METHOD   the head says type, order and shape; the numbers are read where they stand, a block at a time, and only the columns
//          that are asked for are kept
// REFERENCE  numpy.lib.format, versions 1 to 3
#include "npy.hpp"

#include "error.hpp"
#include "files/input_file.hpp"
#include "files/memory_bound.hpp"
#include "files/nearest_name.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace okid_host {
namespace {

constexpr std::size_t longest_head = 65536, block_bytes = std::size_t{1} << 20;

class npy_file {
  public:
    explicit npy_file(std::string path) : path_(std::move(path)), fd_(open_input(path_, "a .npy file")) {
        try {
            read_head();
        } catch (...) {
            close(fd_);
            throw;
        }
    }
    ~npy_file() { close(fd_); }
    npy_file(const npy_file&) = delete;
    npy_file& operator=(const npy_file&) = delete;

    std::vector<std::string> names() const {
        std::vector<std::string> out;
        for (std::size_t k = 1; k <= columns_; ++k) out.push_back(fmt::format("c{}", k));
        return out;
    }
    std::size_t rows() const { return rows_; }
    void read(const std::vector<std::size_t>& wanted, double* to) const;

  private:
    void read_head();
    void take_shape(std::string_view text);
    std::string_view entry(std::string_view key) const;
    void read_at(std::size_t at, void* to, std::size_t bytes) const;
    double number(const unsigned char* at) const;
    double checked(std::size_t row, std::size_t column, double value) const {
        if (std::isinf(value))
            refuse(fmt::format("row {}, column c{}: found inf, expected a finite number (an overrange sample is no "
                               "measurement; mark it nan)",
                               row + 1, column + 1));
        return value;
    }
    [[noreturn]] void refuse(const std::string& what) const {
        throw failure(exit_usage, fmt::format("{}: {}", path_, what));
    }

    std::string path_, head_;
    int fd_;
    std::size_t begin_ = 0, rows_ = 0, columns_ = 1, width_ = 0; ///< of the numbers; bytes of one
    char kind_ = 'f';                                            ///< f, i, u
    bool swapped_ = false, by_columns_ = false;
};

void npy_file::read_at(std::size_t at, void* to, std::size_t bytes) const {
    for (auto* out = static_cast<char*>(to); bytes > 0;) {
        const ssize_t got = pread(fd_, out, bytes, static_cast<off_t>(at));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
        if (got == 0) refuse("the file is cut off");
        out += got;
        at += static_cast<std::size_t>(got);
        bytes -= static_cast<std::size_t>(got);
    }
}

/// What stands behind 'key': in the head, up to the next key.
std::string_view npy_file::entry(std::string_view key) const {
    const std::size_t at = head_.find(fmt::format("'{}':", key));
    if (at == std::string::npos) refuse(fmt::format("its head says no {}, expected a file of numpy.save()", key));
    std::string_view text = std::string_view(head_).substr(at + key.size() + 3);
    text.remove_prefix(std::min(text.size(), text.find_first_not_of(' ')));
    return text;
}

void npy_file::take_shape(std::string_view text) {
    std::vector<std::size_t> shape;
    const std::size_t close = text.find(')');
    if (text.empty() || text[0] != '(' || close == std::string_view::npos) refuse("its head says no shape");
    const char *at = text.data() + 1, *end = text.data() + close;
    while (at < end) {
        std::size_t size = 0;
        const auto [stop, error] = std::from_chars(at, end, size);
        if (error != std::errc{}) break;
        shape.push_back(size);
        for (at = stop; at < end && (*at == ',' || *at == ' ');) ++at;
    }
    if (shape.empty() || shape.size() > 2)
        refuse(fmt::format("found an array of {} dimensions, expected samples × channels", shape.size()));
    rows_ = shape[0];
    if (shape.size() == 2) columns_ = shape[1];
    if (rows_ == 0 || columns_ == 0 || columns_ > 1000000 || rows_ > (std::size_t{1} << 48) / columns_)
        refuse(fmt::format("found {} samples of {} channels, expected some", rows_, columns_));
}

void npy_file::read_head() {
    unsigned char fixed[12];
    struct stat status{};
    if (fstat(fd_, &status) != 0 || !S_ISREG(status.st_mode)) refuse("is no regular file");
    const auto size = static_cast<std::size_t>(status.st_size);
    if (size < sizeof fixed) refuse("is no .npy file: it is too short");
    read_at(0, fixed, sizeof fixed);
    if (std::memcmp(fixed, "\x93NUMPY", 6) != 0 || fixed[6] < 1 || fixed[6] > 3)
        refuse("is no .npy file of version 1 to 3, expected what numpy.save() writes");
    const std::size_t words = fixed[6] == 1 ? 2 : 4;
    std::size_t length = 0;
    for (std::size_t k = words; k-- > 0;) length = length << 8 | fixed[8 + k];
    begin_ = 8 + words + length;
    if (length > longest_head || begin_ > size) refuse("is no .npy file: its head is cut off");
    head_.resize(length);
    read_at(8 + words, head_.data(), length);
    const std::string_view type = entry("descr");
    const bool plain = type.size() > 4 && type[0] == '\'' && type[4] == '\'' && std::strchr("<>|=", type[1]) &&
                       std::strchr("fiu", type[2]) && std::strchr("1248", type[3]);
    width_ = plain ? static_cast<std::size_t>(type[3] - '0') : 0;
    if (!plain || (type[2] == 'f' && width_ < 4))
        refuse(fmt::format("found numbers of type {}, expected float64, float32, or integers",
                           printable(std::string(type.substr(0, std::min<std::size_t>(type.find(", '"), 40))))));
    kind_ = type[2];
    swapped_ = type[1] == '>';
    by_columns_ = entry("fortran_order").substr(0, 4) == "True";
    take_shape(entry("shape"));
    const std::size_t expected = rows_ * columns_ * width_;
    if (size - begin_ != expected)
        refuse(
            fmt::format("found {} bytes of numbers, expected {} for {} samples of {} channels: the file is cut off or "
                        "damaged",
                        size - begin_, expected, rows_, columns_));
}

double npy_file::number(const unsigned char* at) const {
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < width_; ++k) bits |= std::uint64_t{at[swapped_ ? width_ - 1 - k : k]} << (8 * k);
    if (kind_ == 'f' && width_ == 8) {
        double value = 0;
        std::memcpy(&value, &bits, sizeof value);
        return value;
    }
    if (kind_ == 'f') {
        const auto half = static_cast<std::uint32_t>(bits);
        float value = 0;
        std::memcpy(&value, &half, sizeof value);
        return static_cast<double>(value);
    }
    const std::uint64_t sign = std::uint64_t{1} << (8 * width_ - 1);
    if (kind_ == 'u') return static_cast<double>(bits);
    return static_cast<double>(static_cast<std::int64_t>((bits ^ sign) - sign));
}

/// @param to  the columns wanted, one sample after the other
void npy_file::read(const std::vector<std::size_t>& wanted, double* to) const {
    const std::size_t stride = by_columns_ ? width_ : width_ * columns_;
    const std::size_t at_once = std::max<std::size_t>(1, block_bytes / stride);
    std::vector<unsigned char> block(at_once * stride);
    const auto take = [&](std::size_t first, std::size_t count, std::size_t k, std::size_t offset) {
        for (std::size_t i = 0; i < count; ++i)
            to[(first + i) * wanted.size() + k] =
                checked(first + i, wanted[k], number(block.data() + i * stride + offset));
    };
    for (std::size_t first = 0; first < rows_; first += at_once) {
        const std::size_t count = std::min(at_once, rows_ - first);
        if (!by_columns_) read_at(begin_ + first * stride, block.data(), count * stride);
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            if (by_columns_) read_at(begin_ + (wanted[k] * rows_ + first) * width_, block.data(), count * width_);
            take(first, count, k, by_columns_ ? 0 : wanted[k] * width_);
        }
    }
}

} // namespace

bool is_npy(const std::string& path) { return std::filesystem::path(path).extension() == ".npy"; }

std::vector<std::string> read_npy_columns(const std::string& path) { return npy_file(path).names(); }

csv_record read_npy(const std::string& path, const csv_request& request) {
    const npy_file file(path);
    const std::vector<std::string> names = file.names();
    csv_record out;
    out.path = path;
    out.columns = request.whole ? names : request.columns;
    out.units.resize(out.columns.size());
    std::vector<std::size_t> wanted;
    for (const std::string& name : out.columns) {
        const auto found = std::find(names.begin(), names.end(), name);
        if (found == names.end())
            throw failure(exit_usage, fmt::format("{}: no column \"{}\"; the columns of an array are c1 to c{}", path,
                                                  printable(name), names.size()));
        wanted.push_back(static_cast<std::size_t>(found - names.begin()));
        if (std::count(wanted.begin(), wanted.end(), wanted.back()) > 1)
            throw failure(exit_usage, fmt::format("{}: \"{}\" stands there twice", path, name));
    }
    if (!request.fs_hz && !request.whole)
        throw failure(exit_usage, fmt::format("{}: no sample rate: an array has none; expected --fs HZ", path));
    out.fs_hz = request.fs_hz.value_or(0);
    out.count = file.rows();
    out.first_line = 1;
    require_samples(path, out.count, wanted.size());
    out.samples.resize(out.count * wanted.size());
    file.read(wanted, out.samples.data());
    if (!request.whole) check_columns(path, out.columns, out.columns.size(), out.samples.data(), out.count);
    return out;
}

} // namespace okid_host
