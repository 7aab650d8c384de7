// SPDX-License-Identifier: MIT
// Gram matrix of many columns, one after the other: they are multiplied in blocks. And such a matrix with a unit diagonal.
#pragma once
#include <Eigen/Dense>

namespace okid_host {

class gram_sum {
  public:
    static constexpr Eigen::Index block = 256; ///< columns

    explicit gram_sum(Eigen::Index size)
        : sum_(Eigen::MatrixXd::Zero(size, size)), columns_(Eigen::MatrixXd::Zero(size, block)) {}

    /// The next column, for its values to be written; it counts once it is kept.
    Eigen::MatrixXd::ColXpr next() { return columns_.col(filled_); }
    void keep() {
        ++kept_;
        if (++filled_ == block) fold();
    }
    /// Multiply what was kept, though the block is not full.
    void fold() {
        if (filled_ == 0) return; // Eigen 3.4 divides by the number of columns
        sum_.selfadjointView<Eigen::Lower>().rankUpdate(columns_.leftCols(filled_));
        filled_ = 0;
    }

    Eigen::Index kept() const { return kept_; } ///< columns
    /// Both triangles, of all that was folded.
    Eigen::MatrixXd values() const { return sum_.selfadjointView<Eigen::Lower>(); }

  private:
    Eigen::MatrixXd sum_, columns_;
    Eigen::Index filled_ = 0, kept_ = 0;
};

/// A symmetric matrix with a unit diagonal: what it was divided by is the square of `size`.
struct scaled_matrix {
    Eigen::VectorXd size;
    Eigen::MatrixXd values;

    explicit scaled_matrix(const Eigen::MatrixXd& given) : size(given.diagonal().cwiseMax(1e-300).cwiseSqrt()) {
        const Eigen::VectorXd unit = size.cwiseInverse();
        values = unit.asDiagonal() * given * unit.asDiagonal();
    }
};

} // namespace okid_host
