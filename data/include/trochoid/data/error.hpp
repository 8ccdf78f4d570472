#pragma once
#include <stdexcept>
#include <string>

namespace trochoid {

/// Base of every error trochoid throws. The message is one line that names the place (file, line,
/// field, frame), the offending value and what would be right.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A promise broken by the caller or by a file: missing, malformed, out of range.
class InputError : public Error {
 public:
  using Error::Error;
};

/// What is wrong with a track that is already in memory. The message cannot say which file the
/// track was read from; whoever read it can.
class TrackError : public InputError {
 public:
  using InputError::InputError;
};

/// A computation that cannot deliver what was asked (not an unwelcome answer: those are outcomes).
class NumericalError : public Error {
 public:
  using Error::Error;
};

}  // namespace trochoid
