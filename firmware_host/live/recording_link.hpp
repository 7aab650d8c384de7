// SPDX-License-Identifier: MIT
// Between a recorder and what its frames go to beside it: the trigger one way, news the other way.
#pragma once
#include "journal/recorder.hpp"
#include "stream_target.hpp"

#include <memory>
#include <optional>

namespace okid_host {

class recording_link {
  public:
    /// Nothing is recorded without options. Throws `failure` (exit 2).
    recording_link(const live_config& config, const std::optional<recorder_options>& options)
        : recorder_(options ? std::make_unique<recorder>(config, *options) : nullptr) {
        if (recorder_) recorder_->start();
    }
    /// NULL when nothing is recorded.
    recorder* get() { return recorder_.get(); }

    /// Call this regularly.
    void serve(stream_target& target) {
        if (!recorder_) return;
        if (!triggered_ && target.triggered()) {
            triggered_ = true;
            recorder_->trigger(target.trigger_ns());
        }
        if (!target.heard()) return; // the stream begins with its own event
        for (const recording_news& one : recorder_->news()) target.record_event(one.kind, one.text);
    }
    /// After the last frame.
    void finish(stream_target& target) {
        if (!recorder_) return;
        serve(target);
        recorder_->stop();
        serve(target);
    }

  private:
    std::unique_ptr<recorder> recorder_;
    bool triggered_ = false;
};

} // namespace okid_host
