// SPDX-License-Identifier: MIT
// A stream of samples and what is known of it: updates while it runs, results whenever they are wanted. The live program and
// other languages feed the same object.
#pragma once
#include "identifier.hpp"
#include "mode_tracks.hpp"
#include "result/result.hpp"
#include "settling.hpp"

#include <cstdint>
#include <optional>

namespace okid_host {

/// What an update found.
struct stream_update {
    struct change {
        std::int64_t sample; ///< where it began, about
        bool restarted;      ///< earlier samples were discarded
    };
    std::optional<change> changed; ///< since the last update
    std::int64_t rows = 0;         ///< equations at hand
    okid_status_t status = OKID_ERR_TOO_SHORT;
    std::optional<deviations> sigma;          ///< of the modes
    const std::vector<int>* tracks = nullptr; ///< of each mode, 0 = none; only with a model
    bool settled = false;                     ///< the modal table has settled
    std::int64_t since = 0;                   ///< sample at which it was decided which modes there are
};

class stream {
  public:
    /// Throws `failure` (exit 2) as identifier does.
    explicit stream(stream_config config);

    const stream_config& config() const { return config_; }
    identifier& sums() { return identifier_; }
    const okid_identified_t& model() const { return identifier_.model(); }
    /// Equations an update needs: with fewer a model only repeats the noise.
    std::int64_t needed() const { return 2 * identifier_.unknowns(); }

    /// Must an update be made now, however late it is? The samples that come are compared with its model, when it is at
    /// rest, and the result depends on that. Three updates in a row, then none until half of the memory is new.
    bool obliged() const {
        return identifier_.decides() && identifier_.wants_model() && identifier_.samples() >= look_at_;
    }
    /// May it be left out? Yes when it is not obliged, and the next one is due already.
    /// @param ahead  samples that came behind it, up to the newest update; hurry: whatever came behind it
    bool may_skip(std::int64_t ahead, bool hurry) {
        return identifier_.rows() >= needed() && !obliged() && (hurry || identifier_.due_after(ahead));
    }
    /// Leave it out. The later ones, and the result, are the same as if it had been made.
    void skip() { identifier_.pass(); }
    /// What the watch noticed since the last call, or the last update. Before it is asked whether an update may be left out.
    std::optional<stream_update::change> take_change(std::int64_t now);
    /// Identify, follow the modes, and watch what comes from a model at rest on. Nothing in the sums changes.
    /// @param now  samples of the stream so far, as messages count them
    stream_update update(std::int64_t now);
    bool settled() const { return settled_; }                                ///< at the last update
    bool at_rest(std::size_t mode) const { return settling_.at_rest(mode); } ///< of the last update
    void reset();
    /// identifier::state() behind rate and channels of the stream, restore() and merge() compare them.
    std::vector<std::byte> state();
    void restore(const void* state, std::size_t bytes);
    void merge(const void* state, std::size_t bytes);

    /// Identify for a result. Throws `failure` (exit 3) when no model is possible.
    void identify();
    /// Throws `failure` (exit 3): why the last identification gave no model.
    [[noreturn]] void refuse(okid_status_t status, const result_context& about) const;
    /// Is there anything to update? Auto decides which modes there are when enough is new (agreement::due()), and
    /// follows those it has in between.
    bool due() const { return identifier_.due(); }
    /// What is known of the result of the last identify() or update(), without standard deviations.
    /// @param said  what to say first
    result_context context(remarks said = {});
    /// Of the modes of the last identify() or update().
    std::vector<mode_verdict> verdicts() const {
        return mode_verdicts(model(), identifier_.agreed() ? identifier_.agreed()->found().context : result_context{});
    }
    /// Found by auto, but doubtful: in the events, not in the table; no track, no alarm.
    bool doubtful(std::size_t mode) const {
        return identifier_.agreed() && !identifier_.agreed()->found().context.verdicts[mode].confident;
    }
    /// Outputs that the model of the last identify() hardly follows.
    void remark_fit(result_context& about);
    /// M, K and R where they are wanted; if they fail, the modes stay.
    void add_mass(result_context& about) const;
    /// Standard deviations of modes and matrices.
    void add_sigma(result_context& about);

  private:
    void forget_updates();
    void give_tracks(mode_tracks& by, std::vector<int>& to);
    void look_for_baseline(const stream_update& found);

    stream_config config_;
    identifier identifier_;
    settling settling_;
    mode_tracks tracks_;
    std::vector<int> signed_tracks_; ///< of the last update, 0 where a mode is doubtful
    settling baseline_settling_;     ///< of the obliged updates alone
    mode_tracks baseline_tracks_;
    std::vector<int> baseline_signed_;
    std::int64_t since_ = 0;   ///< stream_update::since
    int looks_ = 0;            ///< obliged updates in a row
    std::int64_t look_at_ = 0; ///< the next one, in samples that ever came
    bool settled_ = false;
    std::int64_t samples_seen_ = -1; ///< complete ones, by the last update
    std::int64_t changed_at_ = 0, restarted_at_ = 0, restarts_reported_ = 0;
};

} // namespace okid_host
