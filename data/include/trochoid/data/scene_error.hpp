#pragma once
#include <string>
#include <utility>

#include "trochoid/data/error.hpp"

namespace trochoid::data {

/// What is wrong with a scene's text, and on which line: whoever made the text can say what that
/// line stands for.
class SceneError : public InputError {
 public:
  SceneError(const std::string& where, unsigned line, std::string words)
      : InputError(where + ":" + std::to_string(line) + ": " + words),
        line_(line),
        words_(std::move(words)) {}
  [[nodiscard]] unsigned line() const { return line_; }  ///< counted from 1
  [[nodiscard]] const std::string& words() const { return words_; }

 private:
  unsigned line_;
  std::string words_;
};

}  // namespace trochoid::data
