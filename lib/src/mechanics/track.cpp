// SPDX-License-Identifier: MIT
// PURPOSE    modes followed from update to update
// METHOD     distance of every mode from every track in frequency and MAC, with the shape last seen and with the mean of some
//            ten: where modes cross within the memory of the models the newest shapes are mixtures. Optimal assignment by
//            shortest augmenting paths, in which staying alone costs 1; candidates become tracks after consecutive hits
// REFERENCE  Jonker, Volgenant (1987), the assignment; MAC: Pappa, Elliott, Schenk (1993)
// NUMERICS   only ratios of frequencies and MACs enter: nothing depends on units. A track is where it was last seen, so a
//            slow drift of any size is followed; ties go to the older track
// WORKSPACE  tracks (4 n_y + 7 numbers each) and a table of (modes + tracks) x tracks distances; n^3 flop at worst
#include <okid/modal.h>
#include <okid/track.h>

#include "linalg/arena.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

using std::size_t;

struct okid_tracks {
    okid_track_config_t config;
    int32_t count, born, jumping;
    okid_track_t* track;
    okid_real_t *shape_re, *shape_im; // n_y x max_tracks, when last seen
    okid_real_t *mean_re, *mean_im;   // the same, remembered
    int32_t* mode;                    // which one it is in the newest update, -1 none
    // Of one update: rows are modes, columns tracks, then one private column a mode for staying alone.
    double *cost, *row_price, *column_price, *slack;
    int32_t *owner, *way, *of_mode;        // mode of a column, column before it on the path; track of a mode; -1 none
    uint8_t *in_tree, *mode_close, *close; // of the newest update's modes; of tracks, when last seen
};

namespace {

constexpr double alone = 1;        // the cost of a mode without a track
constexpr double remembered = 0.1; // weight of the newest shape in the mean, at least
constexpr int missed = 10;         // part of the updates after which a track ends: it is not coming back
constexpr double by_memory = 0.35; // weight of the mean beside the shape last seen: what veers follows the latter

size_t lay_out(okid_tracks& s, okid::arena& memory) {
    const auto tracks = static_cast<size_t>(s.config.max_tracks), modes = static_cast<size_t>(s.config.max_modes);
    const size_t shapes = tracks * static_cast<size_t>(s.config.n_y), columns = tracks + modes + 1;
    s.track = memory.take<okid_track_t>(tracks);
    for (okid_real_t** each : {&s.shape_re, &s.shape_im, &s.mean_re, &s.mean_im})
        *each = memory.take<okid_real_t>(shapes);
    s.mode = memory.take<int32_t>(tracks);
    s.cost = memory.take<double>(modes * tracks);
    s.row_price = memory.take<double>(modes);
    for (double** each : {&s.column_price, &s.slack}) *each = memory.take<double>(columns);
    for (int32_t** each : {&s.owner, &s.way}) *each = memory.take<int32_t>(columns);
    s.of_mode = memory.take<int32_t>(modes);
    s.in_tree = memory.take<uint8_t>(columns);
    s.mode_close = memory.take<uint8_t>(modes);
    s.close = memory.take<uint8_t>(tracks);
    return memory.bytes();
}

bool valid(const okid_track_config_t& c) {
    const auto within = [](double x, double most) { return x >= 0 && x < most; };
    return c.n_y >= 1 && c.n_y <= 4096 && c.max_modes >= 1 && c.max_modes <= 4096 && c.max_tracks >= 1 &&
           c.max_tracks <= 4096 && c.born >= 0 && c.dies >= 0 && within(c.frequency, 1) && within(c.jump, 1) &&
           c.close_hz >= 0 && within(c.mac, 1);
}

okid_tracks plan(const okid_track_config_t& c) {
    okid_tracks s{};
    s.config = c;
    if (c.born == 0) s.config.born = 3;
    if (c.dies == 0) s.config.dies = 100;
    if (c.frequency == 0) s.config.frequency = 0.05;
    if (c.jump == 0) s.config.jump = 0.3;
    if (c.mac == 0) s.config.mac = 0.5;
    return s;
}

struct mode_view {
    const okid_real_t *frequency_hz, *damping_ratio, *shape_re, *shape_im;
};

size_t column_of(const okid_tracks& s, int k) { return static_cast<size_t>(s.config.n_y) * static_cast<size_t>(k); }

/// @param lost  the track was lost, and the mode may have moved by up to the configured jump
double distance(const okid_tracks& s, const mode_view& to, int mode, int track, bool lost) {
    const double f = s.track[track].frequency_hz;
    const double reach = lost ? s.config.jump : s.config.frequency;
    const double mac = lost ? 0.5 + 0.5 * s.config.mac : s.config.mac;
    const double apart = (to.frequency_hz[mode] - f) / (reach * f);
    if (std::abs(apart) >= 1) return alone;
    const size_t a = column_of(s, track), b = column_of(s, mode);
    const auto unlike = [&](const okid_real_t* re, const okid_real_t* im) {
        const double like = okid_modal_mac(s.config.n_y, re + a, im + a, to.shape_re + b, to.shape_im + b);
        const double x = (1 - std::min(1.0, like)) / (1 - mac);
        return x * x;
    };
    const double newest = unlike(s.shape_re, s.shape_im);
    const double usual = unlike(s.mean_re, s.mean_im);
    if (lost) return apart * apart + std::min(newest, usual);
    const double weight = s.close[track] != 0 || s.mode_close[mode] != 0 ? 1 : by_memory;
    return apart * apart + (1 - weight) * std::min(1.0, newest) + weight * std::min(1.0, usual);
}

/// Columns 1 … tracks, then 1 a mode; column 0 is where a path begins. Pairs that cost more than being alone are never taken.
double cost(const okid_tracks& s, int mode, int column) {
    if (column > s.count) return column - s.count - 1 == mode ? alone : 1e9;
    const double value =
        s.cost[static_cast<size_t>(mode) * static_cast<size_t>(s.count) + static_cast<size_t>(column - 1)];
    return value < alone ? value : 1e9;
}

/// Extend the tree of shortest paths by its nearest column. @return that column
int grow(okid_tracks& s, int columns, int at) {
    const int mode = s.owner[at];
    double least = std::numeric_limits<double>::infinity();
    int next = 0;
    for (int j = 1; j <= columns; ++j) {
        if (s.in_tree[j] != 0) continue;
        const double reduced = cost(s, mode, j) - s.row_price[mode] - s.column_price[j];
        if (reduced < s.slack[j]) s.slack[j] = reduced, s.way[j] = at;
        if (s.slack[j] < least) least = s.slack[j], next = j;
    }
    for (int j = 0; j <= columns; ++j)
        if (s.in_tree[j] != 0)
            s.row_price[s.owner[j]] += least, s.column_price[j] -= least;
        else
            s.slack[j] -= least;
    return next;
}

/// of_mode <- the pairing of least total cost.
void assign(okid_tracks& s, int modes) {
    const int columns = s.count + modes;
    std::fill(s.owner, s.owner + columns + 1, -1);
    std::fill(s.column_price, s.column_price + columns + 1, 0.0);
    std::fill(s.row_price, s.row_price + modes, 0.0);
    for (int mode = 0; mode < modes; ++mode) {
        std::fill(s.slack, s.slack + columns + 1, std::numeric_limits<double>::infinity());
        std::fill(s.in_tree, s.in_tree + columns + 1, uint8_t{0});
        s.owner[0] = mode;
        int at = 0;
        do {
            s.in_tree[at] = 1;
            at = grow(s, columns, at);
        } while (s.owner[at] >= 0);
        for (; at != 0; at = s.way[at]) s.owner[at] = s.owner[s.way[at]];
    }
    std::fill(s.of_mode, s.of_mode + modes, -1);
    for (int j = 1; j <= s.count; ++j)
        if (s.owner[j] >= 0) s.of_mode[s.owner[j]] = j - 1;
}

/// The mean of track k goes on with the shape just seen, turned and scaled to it.
void remember(okid_tracks& s, int k) {
    const size_t at = column_of(s, k), n = static_cast<size_t>(s.config.n_y);
    okid_real_t *re = s.mean_re + at, *im = s.mean_im + at;
    const okid_real_t *new_re = s.shape_re + at, *new_im = s.shape_im + at;
    double along = 0, across = 0, own = 0, theirs = 0;
    for (size_t i = 0; i < n; ++i) {
        const double a = re[i], b = im[i], c = new_re[i], d = new_im[i];
        along += a * c + b * d, across += b * c - a * d, own += a * a + b * b, theirs += c * c + d * d;
    }
    const double turn = std::hypot(along, across);
    const double scale = turn > 0 && theirs > 0 ? std::sqrt(own / theirs) / turn : 0;
    const double weight = scale > 0 ? std::max(remembered, 1.0 / s.track[k].hits) : 1;
    if (!(weight < 1)) { // the first one: there is no mean yet
        std::copy(new_re, new_re + n, re);
        std::copy(new_im, new_im + n, im);
        return;
    }
    for (size_t i = 0; i < n; ++i) {
        const double c = new_re[i], d = new_im[i];
        const double to_re = scale * (along * c - across * d), to_im = scale * (along * d + across * c);
        re[i] = static_cast<okid_real_t>((1 - weight) * re[i] + weight * to_re);
        im[i] = static_cast<okid_real_t>((1 - weight) * im[i] + weight * to_im);
    }
}

void see(okid_tracks& s, int k, const mode_view& modes, int mode) {
    okid_track_t& track = s.track[k];
    track.frequency_hz = modes.frequency_hz[mode];
    track.damping_ratio = modes.damping_ratio[mode];
    track.misses = 0;
    ++track.hits;
    s.mode[k] = mode;
    const size_t from = column_of(s, mode), to = column_of(s, k), n = static_cast<size_t>(s.config.n_y);
    std::copy(modes.shape_re + from, modes.shape_re + from + n, s.shape_re + to);
    std::copy(modes.shape_im + from, modes.shape_im + from + n, s.shape_im + to);
    s.close[k] = s.mode_close[mode];
    if (s.close[k] == 0 || track.hits == 1) remember(s, k);
}

/// Of track k from track j, which was lost.
double distance_of_track(const okid_tracks& s, int k, int j) {
    const auto frequency = static_cast<okid_real_t>(s.track[k].frequency_hz);
    const mode_view one{&frequency, nullptr, s.shape_re + column_of(s, k), s.shape_im + column_of(s, k)};
    return distance(s, one, 0, j, true);
}

/// The lost track that candidate k, seen for `born` updates, goes on with: the nearest of those not seen since it appeared
/// (then they may have shared an update, of old and new samples mixed).
int lost_track(const okid_tracks& s, int k) {
    int best = -1;
    double least = alone;
    for (int j = 0; j < s.count; ++j) {
        if (s.track[j].number == 0 || s.track[j].misses < s.config.born - 1) continue;
        const double d = distance_of_track(s, k, j);
        if (d < least) least = d, best = j;
    }
    return best;
}

void remove(okid_tracks& s, int k) {
    const int last = --s.count;
    if (k == last) return;
    s.track[k] = s.track[last];
    s.mode[k] = s.mode[last];
    s.close[k] = s.close[last];
    const size_t from = column_of(s, last), to = column_of(s, k), n = static_cast<size_t>(s.config.n_y);
    for (okid_real_t* each : {s.shape_re, s.shape_im, s.mean_re, s.mean_im})
        std::copy(each + from, each + from + n, each + to);
}

/// Candidates live on hits alone, so that all of theirs are consecutive; tracks survive misses.
void age(okid_tracks& s) {
    for (int k = s.count - 1; k >= 0; --k) {
        if (s.track[k].misses == 0) continue;
        if (s.track[k].number == 0 || s.track[k].misses >= s.config.dies) remove(s, k);
    }
}

int holder(const okid_tracks& s, int mode) {
    return static_cast<int>(std::find(s.mode, s.mode + s.count, mode) - s.mode);
}

/// Track k goes on with the number of track j, which ends.
void take_over(okid_tracks& s, int k, int j) {
    s.track[k].number = s.track[j].number;
    s.track[k].hits += s.track[j].hits;
    remove(s, j);
}

/// Candidates seen often enough become tracks, in the order of their frequencies, or go on with one.
void give_birth(okid_tracks& s, int modes) {
    for (int mode = 0; mode < modes; ++mode) {
        const int k = holder(s, mode);
        if (k == s.count || s.track[k].number != 0 || s.track[k].hits < s.config.born) continue;
        const int lost = lost_track(s, k);
        if (lost >= 0)
            take_over(s, k, lost);
        else
            s.track[k].number = ++s.born;
    }
}

/// A mode that jumps stands at both places while the models hold samples from before and after. When it is not seen at the old
/// one any more, the track at the new one takes its number.
void marry(okid_tracks& s) {
    for (int j = s.count - 1; j >= 0; --j) {
        const okid_track_t old = s.track[j];
        if (old.number == 0 || old.misses != std::max(s.config.born, s.config.dies / missed)) continue;
        int best = -1;
        double least = alone;
        for (int k = 0; k < s.count; ++k) {
            const okid_track_t& one = s.track[k];
            const bool another = one.hits - old.misses > std::min(old.hits, s.config.dies); // stood beside it for long
            if (one.number <= old.number || one.misses > 0 || another) continue;
            const double d = distance_of_track(s, k, j);
            if (d < least) least = d, best = k;
        }
        if (best >= 0) take_over(s, best, j);
    }
}

} // namespace

size_t okid_track_memsize(const okid_track_config_t* config) {
    if (config == nullptr || !valid(*config)) return 0;
    okid_tracks s = plan(*config);
    okid::arena memory;
    memory.take<okid_tracks>(1);
    return lay_out(s, memory);
}

okid_status_t okid_track_create(okid_tracks_t** self, const okid_track_config_t* config, void* block, size_t bytes) {
    if (self == nullptr || config == nullptr || block == nullptr) return OKID_ERR_NULL;
    if (!valid(*config)) return OKID_ERR_DIM;
    if (bytes < okid_track_memsize(config)) return OKID_ERR_MEMORY;
    okid::arena memory(block);
    *self = memory.take<okid_tracks>(1);
    **self = plan(*config);
    lay_out(**self, memory);
    return OKID_OK;
}

okid_status_t okid_track_update(okid_tracks_t* self, int32_t count, const okid_real_t* frequency_hz,
                                const okid_real_t* damping_ratio, const okid_real_t* shape_re,
                                const okid_real_t* shape_im, int32_t* number) {
    if (self == nullptr || (count > 0 && (frequency_hz == nullptr || damping_ratio == nullptr || shape_re == nullptr ||
                                          shape_im == nullptr || number == nullptr)))
        return OKID_ERR_NULL;
    okid_tracks& s = *self;
    if (count < 0 || count > s.config.max_modes ||
        !std::all_of(frequency_hz, frequency_hz + count, [](okid_real_t f) { return f > 0 && std::isfinite(f); }))
        return OKID_ERR_DIM;
    const mode_view modes{frequency_hz, damping_ratio, shape_re, shape_im};
    const auto tracks = static_cast<size_t>(s.count);
    for (int m = 0; m < count; ++m) {
        s.mode_close[m] = 0;
        for (int k = 0; k < count; ++k)
            if (k != m && std::abs(frequency_hz[k] - frequency_hz[m]) < s.config.close_hz) s.mode_close[m] = 1;
    }
    for (int m = 0; m < count; ++m)
        for (int k = 0; k < s.count; ++k)
            s.cost[static_cast<size_t>(m) * tracks + static_cast<size_t>(k)] = distance(s, modes, m, k, s.jumping != 0);
    assign(s, count);
    s.jumping = 0;
    for (int k = 0; k < s.count; ++k) ++s.track[k].misses, s.mode[k] = -1;
    for (int m = 0; m < count; ++m)
        if (s.of_mode[m] >= 0) see(s, s.of_mode[m], modes, m);
    age(s);
    for (int m = 0; m < count && s.count < s.config.max_tracks; ++m) {
        if (s.of_mode[m] >= 0) continue;
        const int k = s.count++;
        s.track[k] = {};
        see(s, k, modes, m);
    }
    give_birth(s, count);
    marry(s);
    std::fill(number, number + count, 0);
    for (int k = 0; k < s.count; ++k)
        if (s.mode[k] >= 0) number[s.mode[k]] = s.track[k].number;
    return OKID_OK;
}

void okid_track_jump(okid_tracks_t* self) {
    if (self == nullptr) return;
    for (int k = self->count - 1; k >= 0; --k)
        if (self->track[k].number == 0) remove(*self, k);
    self->jumping = 1;
}

int32_t okid_track_count(const okid_tracks_t* self) { return self != nullptr ? self->count : 0; }

okid_status_t okid_track_get(const okid_tracks_t* self, int32_t k, okid_track_t* out) {
    if (self == nullptr || out == nullptr) return OKID_ERR_NULL;
    if (k < 0 || k >= self->count) return OKID_ERR_DIM;
    *out = self->track[k];
    return OKID_OK;
}
