#include "trochoid/model/outcome.hpp"

namespace trochoid::model {

std::string_view name(Outcome outcome) {
  switch (outcome) {
    case Outcome::reached_end:
      return "reached_end";
    case Outcome::flat:
      return "flat";
    case Outcome::rim_switch:
      return "rim_switch";
    case Outcome::lift_off:
      return "lift_off";
    case Outcome::at_rest:
      return "at_rest";
    case Outcome::inconsistent_contact:
      return "inconsistent_contact";
    case Outcome::step_limit:
      return "step_limit";
    case Outcome::tolerance_not_reachable:
      return "tolerance_not_reachable";
    case Outcome::out_of_domain:
      return "out_of_domain";
    case Outcome::chattering:
      return "chattering";
    case Outcome::diverged:
      return "diverged";
  }
  return "unknown";
}

std::string_view sentence(Outcome outcome) {
  switch (outcome) {
    case Outcome::reached_end:
      return "The run reached its end time.";
    case Outcome::flat:
      return "The body fell flat onto its face.";
    case Outcome::rim_switch:
      return "The body stood upright and its contact jumped to the other rim.";
    case Outcome::lift_off:
      return "The normal force reached zero: the body lifts off.";
    case Outcome::at_rest:
      return "The body came to rest.";
    case Outcome::inconsistent_contact:
      return "No contact force fits the friction law here (Painleve's paradox).";
    case Outcome::step_limit:
      return "The integrator reached its step limit.";
    case Outcome::tolerance_not_reachable:
      return "The tolerance asks for steps below rounding.";
    case Outcome::out_of_domain:
      return "Parameters or state left the model's range.";
    case Outcome::chattering:
      return "Sticking and slipping alternate too fast to be followed.";
    case Outcome::diverged:
      return "A finer run goes another way from here on: lower the tolerance; where that does not "
             "help, rounding decides what follows.";
  }
  return "Unknown.";
}

bool broke_off(Outcome outcome) {
  switch (outcome) {
    case Outcome::step_limit:
    case Outcome::tolerance_not_reachable:
    case Outcome::out_of_domain:
    case Outcome::chattering:
    case Outcome::diverged:
      return true;
    default:
      return false;
  }
}

}  // namespace trochoid::model
