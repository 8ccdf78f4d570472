#include <cmath>

#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

TEST(TableFile, KeepsHeaderColumnsAndEveryBitOfTheValues) {
  const TestFolder folder;
  Table table;
  table.header = {{"trochoid trajectory 1", ""}, {"model", "top"}};
  table.columns = {"t_s", "x_m"};
  table.values.resize(3, 2);
  table.values << 0.1, 1.0 / 3.0, 0.2, std::nan(""), 5e-324, -1.7976931348623157e308;
  write_table(table, folder / "t.csv");
  const Table read = read_table(folder / "t.csv");
  EXPECT_EQ(read.header, table.header);
  EXPECT_EQ(read.columns, table.columns);
  ASSERT_EQ(read.values.rows(), 3);
  EXPECT_TRUE(std::isnan(read.values(1, 1)));
  EXPECT_EQ(read.values.row(0), table.values.row(0));
  EXPECT_EQ(read.values.row(2), table.values.row(2));
  EXPECT_TRUE(read.has("x_m"));
  EXPECT_EQ(read.column("t_s")(1), 0.2);
}

TEST(TableFile, MayLeaveNumbersOutAsAnyToolWritesIt) {
  const TestFolder folder;
  const Table read = read_table(folder.write("t.csv", "t_s,x_m\n0,nan\n1,NaN\n2,-nan\n3,\n4,7\n"));
  ASSERT_EQ(read.values.rows(), 5);
  EXPECT_TRUE(read.values.col(1).head(4).array().isNaN().all());
  EXPECT_EQ(read.values(4, 1), 7.0);
}

TEST(TableFile, NamesTheColumnsThereAreWhenOneIsMissing) {
  Table table;
  table.columns = {"t_s", "x_m"};
  table.values.resize(0, 2);
  const std::string message = refusal([&] { static_cast<void>(table.column("y_m")); });
  EXPECT_NE(message.find("y_m"), std::string::npos);
  EXPECT_NE(message.find("t_s,x_m"), std::string::npos);
}

TEST(TableFile, ReadsAReferenceTrajectory) {
  const Table table =
      read_table(std::filesystem::path(TROCHOID_SOURCE_DIR) / "data/reference/s06_roll_disc.csv");
  EXPECT_EQ(table.values.rows(), 91);
  EXPECT_EQ(table.column("t")(90), 3.0);
}

TEST(TableFile, RefusesValuesThatDoNotFitTheColumnNames) {
  const TestFolder folder;
  Table table;
  table.columns = {"t_s"};
  table.values.resize(2, 2);
  static_cast<void>(refusal([&] { write_table(table, folder / "t.csv"); }));
  EXPECT_EQ(folder.entries(), 0);
}

TEST(TableFile, IsNamedWhenAColumnIsAskedForThatItLacks) {
  const TestFolder folder;
  const Table table = read_table(folder.write("labels.csv", "frame,x_px\n0,1\n"));
  EXPECT_NE(
      refusal([&] { (void)table.column("y_px"); }).find("labels.csv: there is no column y_px"),
      std::string::npos);
}

}  // namespace
}  // namespace trochoid::data
