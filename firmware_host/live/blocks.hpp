// SPDX-License-Identifier: MIT
// The blocks of a running stream that are left out in turn for standard deviations. A window has them in its slots; for a
// growing or fading memory each block has an accumulator of its own beside the whole. All memory at the start.
#pragma once
#include "consensus/owned_sums.hpp"
#include "result/deviations.hpp"

#include <okid/accumulator.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace okid_host {

inline okid_status_t add_samples(okid_accumulator_t* to, const std::int16_t* samples, std::size_t count) {
    return okid_accumulator_add_i16(to, samples, count);
}
inline okid_status_t add_samples(okid_accumulator_t* to, const std::int32_t* samples, std::size_t count) {
    return okid_accumulator_add_i32(to, samples, count);
}
inline okid_status_t add_samples(okid_accumulator_t* to, const float* samples, std::size_t count) {
    return okid_accumulator_add_f32(to, samples, count);
}
inline okid_status_t add_samples(okid_accumulator_t* to, const double* samples, std::size_t count) {
    return okid_accumulator_add(to, samples, count);
}

class live_blocks {
  public:
    static constexpr double remembered = 0.99; ///< share of a fading memory that the blocks cover

    /// @param whole   of the stream
    /// @param blocks  to leave out: a window has about so many, a growing memory from so many to twice as many, a fading
    ///                one twice as many, because the young ones weigh most. Throws `failure` (exit 2) when the memory
    ///                does not suffice
    /// @param analytic  to first order, where the method has a derivative
    /// @param states_only  only take() is called: there is no memory for other blocks
    live_blocks(const okid_accumulator_config_t& whole, const okid_identify_config_t& identify, int blocks,
                bool analytic, bool states_only);

    void set_units(const std::vector<double>& scale, const std::vector<double>& offset);

    /// How many of `count` samples may go into the whole before the next call of add().
    std::size_t room(const okid_accumulator_t* whole, std::size_t count) const;
    /// The same samples that went into the whole just now; likewise what is missing.
    template <class Number> void add(const okid_accumulator_t* whole, const Number* samples, std::size_t count);
    void gap(const okid_accumulator_t* whole, std::int64_t count);

    /// Sums that were merged into a growing whole: one more block.
    void take(owned_sums more) { given_.push_back(std::move(more)); }

    /// Start again, as the whole does.
    void reset();

    /// A window from slot `first` on, as one record from 1 on. Valid until the next call of this or of sigma().
    okid_accumulator_t* gather(okid_accumulator_t* whole, std::int32_t first);

    /// Standard deviations of `model`, which the last run of `by` identified from `whole`; none with too few blocks.
    /// @param first  of a window: the model was identified from what gather() gives of this slot
    std::optional<deviations> sigma(okid_accumulator_t* whole, okid_identify_t* by, const okid_identified_t& model,
                                    const mass_plan& plan, std::int32_t first = 0);

  private:
    struct part : owned_sums {
        std::int64_t closed_at = 0; ///< rows in closed slots of the whole when it ended
    };
    bool window() const { return whole_.slots > 0; }
    bool fading() const { return whole_.forgetting < 1; }
    part make() const;
    void turn(const okid_accumulator_t* whole);
    void begin_part();
    template <class Code> void begin_with(okid_accumulator_t* sums, std::vector<Code>& codes);
    void pair_up();
    void delete_parts(okid_accumulator_t* whole, replicate_statistics& to);
    void delete_slots(okid_accumulator_t* whole, std::int32_t from, replicate_statistics& to);
    okid_accumulator_t* together(okid_accumulator_t* whole, std::int32_t first);
    void leave_out(okid_accumulator_t* one, double weight, replicate_statistics& to);
    bool begin(okid_accumulator_t* whole, okid_identify_t* by, const okid_identified_t& model, bool mass,
               std::int32_t first);
    bool begin_again(okid_accumulator_t* whole, const okid_identified_t& model, std::int32_t first);

    okid_accumulator_config_t whole_, sums_{};
    std::size_t m_, blocks_;
    std::int64_t length_ = 0; ///< rows of a part
    std::vector<part> parts_; ///< parts_[open_] grows; window: all slots together, then one group of them
    std::size_t open_ = 0;
    std::vector<owned_sums> given_;
    std::vector<double> history_;     ///< the last samples of the run, at most `lags`
    std::vector<std::int16_t> codes_; ///< the same as codes, when a part begins
    std::vector<std::int32_t> wide_codes_;
    std::unique_ptr<std::byte[]> linear_block_, again_block_;
    okid_jackknife_t *linear_ = nullptr,
                     *again_ = nullptr;     ///< to first order (NULL: there is no derivative), identified again
    okid_jackknife_t* jackknife_ = nullptr; ///< the one in use
    double most_of_one_ = 0;                ///< largest share of the channels' power that one block had
    std::unique_ptr<replicate_statistics> modes_;
    int n_u_, n_y_, most_states_;
    bool linear_mass_; ///< the derivative has B and D
    double dt_;
};

} // namespace okid_host
