#include "start/find.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "trochoid/data/parallel.hpp"

namespace trochoid::fitting {
namespace {

bool is_spin(const Problem& problem, int free_index) {
  const std::string& name = problem.predictor->parameters()[problem.free[free_index].index].name;
  return name == "psi_rad" || name == "omega_s_rad_s";
}

// Starts the spin angle once the path is known, and takes its readings in.
Found with_spin(const Problem& problem, Found found) {
  if (!found.solution.usable) return found;
  Problem whole = problem;
  for (int i = 0, j = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (!is_spin(problem, i))
      whole.base[0][problem.free[i].index] = problem.free[i].transform.value(found.solution.u[j++]);
  Eigen::VectorXd sign;
  fold_tilt(*problem.predictor, whole.base[0], sign);
  start_spin(whole, 0);
  constexpr double kNear = 1e-5;  // the polish goes on from there
  found.solution = minimise(whole, whole.start(), {.function_tolerance = kNear});
  return found;
}

// Values of an arc's solution by name; the velocity from the path where the state has none.
Start start_from(const Problem& solved, const std::string& path) {
  Start start{path, {}};
  const auto& parameters = solved.predictor->parameters();
  for (int i = 0; i < static_cast<int>(parameters.size()); ++i)
    start.values[parameters[i].name] = solved.base[0][i];
  if (solved.predictor->index_of("vx_m_s") >= 0) return start;
  constexpr double kShort_s = 1e-4;
  const double start_s = solved.arcs[0].start_s;
  const std::vector<double> t_s{start_s, start_s + kShort_s};
  model::PredictRequest request;
  request.t_s = t_s;
  request.start_s = start_s;
  const Eigen::VectorXd xy = solved.predictor->predict(solved.base[0], request).values;
  start.values["vx_m_s"] = (xy[2] - xy[0]) / kShort_s;
  start.values["vy_m_s"] = (xy[3] - xy[1]) / kShort_s;
  return start;
}

// What an easier model makes of the losses stands for what it lacks itself.
Start with_given_losses(const Problem& problem, Start start) {
  for (const FreeParameter& parameter : problem.free)
    if (is_loss(problem, parameter))
      start.values[problem.predictor->parameters()[parameter.index].name] = parameter.given;
  return start;
}

// The same problem for an easier model, whose friction sets in as softly as that model says.
Problem eased(const Problem& problem, const model::Predictor& model) {
  Problem easier = for_predictor(problem, model);
  if (const int slip = model.index_of(kSlipScale); slip >= 0)
    for (Eigen::VectorXd& base : easier.base) base[slip] = model.parameters()[slip].value;
  return easier;
}

// From a relative's solution over its bridges: a start for the model itself.
Start carried_over(const Problem& problem, const Relative& relative, Start start) {
  for (const model::Predictor* bridge : relative.bridges) {
    Problem between = eased(problem, *bridge);
    apply(start, between);
    const Solution solution =
        minimise(between, between.start(), {.iterations = 20, .function_tolerance = 1e-3});
    if (!solution.usable) continue;
    between.set_base(solution.u);
    start = start_from(between, start.path);
  }
  return start;
}

constexpr double kRoughly = 0.05;  // of the variance: somewhere near the right valley

// Whether nothing holds a body in its attitude or its turning.
bool leans_as_it_likes(const Problem& problem) {
  constexpr const char* kNames[] = {"theta_rad", "phi_rad", "w1_rad_s", "w2_rad_s", "w3_rad_s"};
  return std::all_of(std::begin(kNames), std::end(kNames), [&](const char* name) {
    const int index = problem.predictor->index_of(name);
    return std::any_of(problem.free.begin(), problem.free.end(),
                       [&](const FreeParameter& free) { return free.index == index; });
  });
}

// The better of a solution and what its look-alikes lead to.
Found better_of_lookalikes(const Problem& problem, const SearchRequest& asked, Found found) {
  if (!asked.lookalikes || !leans_as_it_likes(problem)) return found;
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem solved = problem;
  solved.set_base(found.solution.u);
  name_attitudes(solved);
  for (const Start& start : asked.lookalikes(start_from(solved, found.path))) {
    if (exhausted(problem, found)) break;
    Found other = grow(problem, start, std::max(24, all / 8));
    if (better(other, found)) found = std::move(other);
  }
  return found;
}

// Without angles neighbouring valleys explain the path nearly as well as the right one; a sliding
// body has some with them too. About a path that is not even roughly the body's there is nothing.
Found look_about(const Problem& problem, const SearchRequest& asked, Found found) {
  constexpr int kMisses = 3;
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool slides = problem.predictor->model_name() == "sliding";
  const bool rim = problem.predictor->index_of("w1_rad_s") >= 0;
  if (!rim || (seen && !slides) || found.unexplained > kRoughly) return found;
  if (!seen) found = better_of_lookalikes(problem, asked, std::move(found));
  if ((seen || !slides) && surely_explained(problem, found)) return found;
  return basin_hop(problem, std::move(found), kMisses);
}

// The coefficients of friction, clearly different, that leave least of a problem unexplained, best
// first: where its body rolls to the end, or slides from another instant on, derivatives do not
// lead to the right one.
std::vector<double> likeliest_frictions(const Problem& part) {
  constexpr double kLeast = 0.02, kMost = 0.9, kStep = 1.25;
  constexpr std::size_t kTried = 2;
  constexpr double kApart = 0.04;  // of friction
  std::vector<std::pair<double, double>> scored;
  const auto try_friction = [&](double friction) {
    Problem at = part;
    apply({"", {{"friction", friction}}}, at);
    Eigen::VectorXd residuals;
    if (evaluate(at, 0, at.start(), residuals, nullptr))
      scored.emplace_back(residuals.squaredNorm(), friction);
    std::sort(scored.begin(), scored.end());
  };
  for (double friction = kLeast; friction < kMost; friction *= kStep) try_friction(friction);
  // A few per cent of friction decide at which turn a body first slides.
  for (const double finer : {0.12, 0.06, 0.03, 0.015, 0.007}) {
    if (scored.empty()) break;
    const double friction = scored.front().second;
    try_friction(friction * (1.0 - finer));
    try_friction(friction * (1.0 + finer));
  }
  std::vector<double> frictions;
  for (const auto& [chi2, friction] : scored)
    if (frictions.size() < kTried &&
        std::none_of(frictions.begin(), frictions.end(), [friction = friction](double other) {
          return std::abs(friction - other) < kApart * other;
        }))
      frictions.push_back(friction);
  return frictions;
}

// A start that rolls for `window` samples, with the coefficients of friction that explain most of
// somewhat more than that, best first.
std::vector<Start> with_frictions(const Problem& problem, const Start& start, int window) {
  constexpr double kFurther = 1.3;
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem longer = windowed(problem, std::min(static_cast<int>(kFurther * window) + 8, all));
  apply(start, longer);
  std::vector<Start> starts;
  for (const double friction : likeliest_frictions(longer)) {
    starts.push_back(start);
    starts.back().values["friction"] = friction;
  }
  return starts;
}

// Those starts that say nothing of friction: for a body that rolls.
Starter without_friction(const Starter& starter) {
  return [&starter](const ArcData& window) {
    std::vector<Start> starts = starter(window);
    std::erase_if(starts, [](const Start& start) { return start.values.contains("friction"); });
    return starts;
  };
}

// The search proper, on a problem whose spin angle is out of the way.
Found search_path(const Problem& problem, const SearchRequest& asked) {
  constexpr double kSlowly = 1.2;
  constexpr double kNearlyExplained = 2.0;  // times the gate
  Found best;
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  const auto take = [&](Found found) {
    const Problem kept = without_samples(problem, found.strays_s);
    found = look_about(kept, asked, std::move(found));
    if (better(found, best)) best = std::move(found);
    return surely_found(problem, best);
  };
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  for (const Relative& relative : asked.relatives) {
    Problem easier = eased(problem, *relative.model);
    // From positions alone neighbouring valleys are many, and a start has to be near the right one.
    easier.rough = seen;
    const bool rolls = relative.model->model_name() == "rolling";
    easier.partial = rolls ? std::make_shared<Partial>() : nullptr;
    const Starter starter = rolls && !seen ? without_friction(asked.starter) : asked.starter;
    const Found rough = search(easier, starter, rolls ? Effort::brief : Effort::full);
    if (rough.solution.usable && rough.unexplained < kRoughly) {
      easier.set_base(rough.solution.u);
      const Start near = start_from(easier, rough.path);
      if (take(grow(problem, carried_over(problem, relative, near), all))) return best;
      const Start plain = with_given_losses(problem, near);
      if (take(grow(problem, plain, std::max(24, all / 4), {kSlowly}))) return best;
    }
    // A body may roll for a while and slide then.
    if (!rolls || easier.partial->samples == 0) continue;
    easier.base[0] = easier.partial->values;
    const int window = easier.partial->samples;
    // An extra try: unless it explains all there is the search goes on as without it. From
    // positions alone there is much left to search when a try has used up its steps.
    const double work = *problem.work;
    for (const Start& start : with_frictions(problem, start_from(easier, "rolls_first"), window)) {
      const bool enough =
          take(grow(problem, start, window, {kSlowly, seen ? 0.0 : kNearlyExplained}));
      if (!seen) *problem.work = work;
      if (enough && surely_found(problem, best)) return best;
    }
    *problem.work = work;
  }
  const bool brief = asked.options->strategy == Strategy::brief;
  if (!exhausted(problem, best))
    take(search(problem, asked.starter, brief ? Effort::brief : Effort::full));
  return best;
}

// How many samples a rolling body's values explain, from the first one on.
int explained_samples(const Problem& problem) {
  constexpr double kLonger = 1.1;
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  int explained = 0;
  for (int window = std::min(24, all);;
       window = std::min(static_cast<int>(kLonger * window), all)) {
    const Problem part = windowed(problem, window);
    Eigen::VectorXd residuals;
    if (!evaluate(part, 0, part.start(), residuals, nullptr) ||
        residuals.squaredNorm() > chi2_gate(part.rows()) * part.rows())
      return explained;
    explained = window;
    if (window == all) return explained;
  }
}

double reduced_chi2(const Problem& problem, const Solution& solution) {
  return solution.usable ? solution.chi2 / free_rows(problem)
                         : std::numeric_limits<double>::infinity();
}

// The best of `known` and what is found from the likeliest coefficients of friction.
Solution seek_friction(const Problem& part, Solution known, const SolveOptions& options) {
  for (const double friction : likeliest_frictions(part)) {
    Problem trial = part;
    apply({"", {{"friction", friction}}}, trial);
    Solution found = minimise(trial, trial.start(), options);
    if (reduced_chi2(part, found) < reduced_chi2(part, known)) known = std::move(found);
  }
  return known;
}

// Follows a body that rolls for `window` samples on into sliding, first to a little more than the
// sample `beyond`: windows grow by a few samples, and where the path is lost the friction is looked
// for anew.
Found grow_into_sliding(const Problem& problem, const Start& start, int window, int beyond) {
  constexpr int kLeastStep = 3, kMostLosses = 12;
  constexpr double kFollowed = 2.0, kWellBeyond = 1.1;  // of the gate; of the samples that roll
  constexpr double kFaster = 1.5, kNear = 10.0;         // of the step; of the gate
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem current = problem;
  apply(start, current);
  int step = beyond - window + std::max(2 * kLeastStep, beyond / 25);
  bool slides = false;
  for (int losses = 0; window < all && losses < kMostLosses && !exhausted(problem, {});) {
    const int next = std::min(window + step, all);
    Problem part = windowed(current, next);
    const SolveOptions options{.iterations = 25, .function_tolerance = 1e-3};
    // The first slips settle the friction; later ones are followed over their ripples.
    const double most = (next > kWellBeyond * beyond ? kFollowed : 1.0) * chi2_gate(part.rows());
    Solution best;
    if (slides) best = minimise(part, part.start(), options);
    if (reduced_chi2(part, best) > most) best = seek_friction(part, std::move(best), options);
    // Short slips that come and go with every parameter make ripples.
    if (const double off = reduced_chi2(part, best); off > most && off < kNear * most)
      best = basin_hop(part, judged(part, std::move(best), start.path), 2).solution;
    if (reduced_chi2(part, best) > most) {
      if (step <= kLeastStep) return {};
      step = std::max(kLeastStep, step / 2);
      ++losses;
      continue;
    }
    part.set_base(best.u);
    current.base = part.base;
    step = slides ? static_cast<int>(kFaster * step) : std::max(2 * kLeastStep, beyond / 25);
    window = next;
    slides = true;
  }
  return window < all ? Found{} : judged(current, solve_to_the_end(current), start.path);
}

// From a given start that rolls, for a while.
Found rolls_first(const Problem& problem, const SearchRequest& asked) {
  if (asked.relatives.empty()) return {};
  Problem rolling = eased(problem, *asked.relatives.front().model);
  apply({"rolls_first", asked.options->start}, rolling);
  const int window = explained_samples(rolling);
  // The first slips bend the rolling body's values before they make them fail.
  for (const double share : {1.0, 0.85, 0.7, 0.55}) {
    const int before = static_cast<int>(share * window);
    constexpr int kFewest = 16;
    if (before < kFewest) break;
    Problem part = windowed(rolling, before);
    const Solution solution =
        minimise(part, part.start(), {.iterations = 20, .function_tolerance = 1e-3});
    if (!solution.usable) continue;
    part.set_base(solution.u);
    rolling.base = part.base;
    Found found = grow_into_sliding(problem, start_from(rolling, "rolls_first"), before, window);
    if (found.solution.usable) return look_about(problem, asked, std::move(found));
  }
  return {};
}

// Where nothing passed, losses that start weaker or stronger may lead elsewhere: a top's nutation
// is lost with its phase. Only where a search takes milliseconds.
Found with_other_losses(const Problem& problem, const SearchRequest& asked, Found best) {
  constexpr double kQuick = 3e5;  // steps
  for (const double factor : {4.0, 0.25, 16.0, 0.06}) {
    Problem other = problem;
    bool any = false;
    for (FreeParameter& parameter : other.free) {
      if (!is_loss(other, parameter)) continue;
      any = true;
      parameter.given *= factor;
      for (Eigen::VectorXd& base : other.base) base[parameter.index] *= factor;
    }
    if (!any || best.passed || *problem.work > kQuick) return best;
    Found found = search_path(other, asked);
    if (better(found, best)) best = std::move(found);
  }
  return best;
}

Found find_arc(Problem problem, const SearchRequest& asked) {
  if (!problem.work) problem.work = std::make_shared<double>(0.0);
  const bool spins = std::any_of(problem.free.begin(), problem.free.end(), [&](const auto& p) {
    return problem.predictor->parameters()[p.index].name == "psi_rad";
  });
  if (spins && problem.arcs[0].observable_index(model::Observable::x_m) >= 0 &&
      problem.predictor->model_name() != "puck") {
    Problem path = problem;
    path.arcs[0] = problem.arcs[0].without(Channel::psi);
    for (int i = static_cast<int>(path.free.size()) - 1; i >= 0; --i)
      if (is_spin(path, i)) path.free.erase(path.free.begin() + i);
    return with_spin(problem, find_arc(path, asked));
  }
  const FitOptions& options = *asked.options;
  const Start given{options.start_path, options.start};
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  switch (options.strategy) {
    case Strategy::single:
      return grow(problem, given, all);
    case Strategy::growing:
      return grow(problem, given, std::max(24, all / 16));
    case Strategy::rolls_first:
      return rolls_first(problem, asked);
    case Strategy::integral:
      return from_best_start(problem, asked.starter);
    case Strategy::multiple:
      return shoot_top(problem, given);
    case Strategy::automatic:
    case Strategy::brief:
      break;
  }
  Found best = with_other_losses(problem, asked, search_path(problem, asked));
  best.cut_short = !best.passed && exhausted(problem, best);
  if (best.passed || !asked.start_given) return best;
  Found from_given = grow(problem, given, std::max(24, all / 8));
  from_given.cut_short = best.cut_short && !from_given.passed;
  return better(from_given, best) ? from_given : best;
}

// Where all arcs together end, and the values the search for that began at.
struct Together {
  Solution solution;
  std::vector<Eigen::VectorXd> base;
};

// @param leader  values of one of them alone, of which it gives those that all share.
Together together_from(const Problem& problem, const Eigen::VectorXd& leader) {
  Problem trial = problem;
  for (const FreeParameter& parameter : problem.free)
    if (parameter.arc < 0)
      for (Eigen::VectorXd& base : trial.base) base[parameter.index] = leader[parameter.index];
  Solution solution = solve(trial, trial.start());
  return {std::move(solution), std::move(trial.base)};
}

// Whether most of these led to the best of them, and that passes the gate.
bool agree(const Problem& problem, std::span<const Together> ends) {
  constexpr double kSame = 1e-4;  // of chi-square, more than a descent leaves
  double least = std::numeric_limits<double>::infinity();
  for (const Together& end : ends)
    if (end.solution.usable) least = std::min(least, end.solution.chi2);
  const auto alike = std::count_if(ends.begin(), ends.end(), [&](const Together& end) {
    return end.solution.usable && end.solution.chi2 <= (1.0 + kSame) * least;
  });
  return 4 * alike >= 3 * std::ssize(ends) &&
         least < chi2_gate(problem.rows()) * free_rows(problem);
}

}  // namespace

// Every arc alone, then all together from each arc's idea of the shared parameters, or, of many,
// from that of a few.
Found find(Problem& problem, const SearchRequest& asked) {
  if (problem.arcs.size() == 1) return find_arc(problem, asked);
  const int arcs = static_cast<int>(problem.arcs.size());
  const int threads = asked.options->threads;
  std::vector<Problem> alone;
  for (int arc = 0; arc < arcs; ++arc) alone.push_back(single_arc(problem, arc));
  std::vector<Found> found(alone.size());
  data::in_parallel(arcs, threads,
                    [&](std::size_t arc) { found[arc] = find_arc(alone[arc], asked); });
  Found best;
  for (int arc = 0; arc < arcs; ++arc) {
    if (!found[arc].solution.usable) {
      if (problem.shortfalls) {
        problem.shortfalls->track = problem.arcs[arc].track;
        problem.shortfalls->samples = static_cast<int>(problem.arcs[arc].t_s.size());
      }
      return found[arc];
    }
    alone[arc].set_base(found[arc].solution.u);
    problem.base[arc] = alone[arc].base[0];
    best.path = arc == 0 || best.path == found[arc].path ? found[arc].path : "mixed";
    best.cut_short |= found[arc].cut_short;
  }
  std::vector<Together> ends(alone.size());
  const auto lead = [&](std::size_t first, std::size_t last) {
    data::in_parallel(last - first, threads, [&](std::size_t i) {
      ends[first + i] = together_from(problem, alone[first + i].base[0]);
    });
  };
  // Where the first few lead to one minimum, so do the others.
  constexpr std::size_t kFew = 4;
  const std::size_t few = std::min(kFew, ends.size());
  lead(0, few);
  if (!agree(problem, std::span(ends).first(few))) lead(few, ends.size());
  for (Together& end : ends) {
    if (!end.solution.usable || (best.solution.usable && end.solution.chi2 >= best.solution.chi2))
      continue;
    best.solution = std::move(end.solution);
    problem.base = std::move(end.base);
  }
  return best;
}

}  // namespace trochoid::fitting
