#include "common/child_process.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

namespace trochoid::tools {
namespace {

using testing::HasSubstr;

TEST(ChildProcess, AProgramThatIsNotThereIsToldAsSuch) {
  const ChildRun run = run_child({"/no/such/program"});
  EXPECT_FALSE(run.started);
  EXPECT_THAT(run.error_output, HasSubstr("cannot be started: No such file"));
}

TEST(ChildProcess, AProgramThatCannotBeStartedHasAReason) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const ChildRun run = run_child({"true"});
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_FALSE(run.started);
  EXPECT_THAT(run.error_output, HasSubstr("cannot be started: Too many open files"));
}

TEST(ChildProcess, AProgramThatASignalEndsHasThatForAReason) {
  const ChildRun run = run_child({"sh", "-c", "echo 'half way' >&2; kill -SEGV $$"});
  EXPECT_LT(run.exit_status, 0);
  EXPECT_EQ(run.error_output,
            "half way\nthe process was ended by signal 11 (Segmentation fault)\n");
}

TEST(ChildProcess, TheLastLineIsTheLastThatSaysAnything) {
  EXPECT_EQ(last_line("first\nsecond \n\n"), "second");
  EXPECT_EQ(last_line("10 %\rbroken"), "broken");
  EXPECT_EQ(last_line("alone"), "alone");
  EXPECT_EQ(last_line(" \n"), "");
}

TEST(ChildProcess, AProgramThatRunsIsFoundWhereverItIs) {
  const ChildRun run = run_child({own_path(), "--gtest_list_tests"});
  EXPECT_TRUE(run.started);
  EXPECT_EQ(run.exit_status, 0);
}

}  // namespace
}  // namespace trochoid::tools
