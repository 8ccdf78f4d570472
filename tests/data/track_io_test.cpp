#include <algorithm>
#include <clocale>
#include <cmath>
#include <locale>

#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

TrackSample full_sample(std::int64_t frame, double t_s) {
  TrackSample sample;
  sample.frame = frame;
  sample.t_s = t_s;
  sample.centre_m = {0.1 + 0.2, -1.0 / 3.0};
  sample.covariance_m2 << 1.1e-9, -2e-10, -2e-10, 3e-9;
  sample.centre_px = {339.02622, 346.54864};
  sample.theta = MeasuredAngle{1.0471975511965976, 0.01};
  sample.psi = MeasuredAngle{-123.4, 0.02};
  sample.quality = 0.97;
  return sample;
}

TrackFile full_file() {
  TrackFile file;
  file.source = "disc.mp4";
  file.source_sha256 = std::string(64, 'a');
  file.camera = "scale from the known radius, 1000 px/m";
  file.made_by = "trochoid 0.1.0";
  file.angles_folded = true;
  file.notes = {"gap: frames 30 to 35", "doubtful: 12"};
  Track track;
  track.samples = {full_sample(0, 0.0), full_sample(1, 1.0 / 240.0), full_sample(3, 3.0 / 240.0)};
  track.samples[1].theta.reset();
  track.samples[1].psi.reset();
  track.samples[2].covariance_m2.setConstant(TrackSample::kUnknown);
  track.samples[2].centre_px.setConstant(TrackSample::kUnknown);
  track.samples[2].quality = TrackSample::kUnknown;
  file.tracks = {track};
  return file;
}

template <class Values>
void expect_same(const Values& a, const Values& b) {
  for (Eigen::Index i = 0; i < a.size(); ++i)
    EXPECT_TRUE(a(i) == b(i) || (std::isnan(a(i)) && std::isnan(b(i)))) << a << " and " << b;
}

void expect_same(const Track& a, const Track& b) {
  EXPECT_EQ(a.object, b.object);
  ASSERT_EQ(a.samples.size(), b.samples.size());
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    const TrackSample &x = a.samples[i], &y = b.samples[i];
    EXPECT_EQ(x.frame, y.frame);
    EXPECT_EQ(x.t_s, y.t_s);
    expect_same(x.centre_m, y.centre_m);
    expect_same(x.covariance_m2, y.covariance_m2);
    expect_same(x.centre_px, y.centre_px);
    EXPECT_EQ(x.theta, y.theta);
    EXPECT_EQ(x.phi, y.phi);
    EXPECT_EQ(x.psi, y.psi);
    EXPECT_TRUE(x.quality == y.quality || (std::isnan(x.quality) && std::isnan(y.quality)));
  }
}

TEST(TrackFile, KeepsEverythingThroughAFile) {
  const TestFolder folder;
  const TrackFile file = full_file();
  write_track(file, folder / "t.csv");
  const TrackFile read = read_track(folder / "t.csv");
  EXPECT_EQ(read.source, file.source);
  EXPECT_EQ(read.source_sha256, file.source_sha256);
  EXPECT_EQ(read.camera, file.camera);
  EXPECT_EQ(read.made_by, file.made_by);
  EXPECT_EQ(read.angles_folded, file.angles_folded);
  EXPECT_EQ(read.notes, file.notes);
  ASSERT_EQ(read.tracks.size(), 1u);
  expect_same(read.tracks[0], file.tracks[0]);
}

TEST(TrackFile, NamesItsColumnsAsDocumented) {
  const TestFolder folder;
  TrackFile file = full_file();
  write_track(file, folder / "angles.csv");
  EXPECT_NE(
      content(folder / "angles.csv")
          .find("\nframe,t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2,x_px,y_px,theta_rad,phi_rad,psi_rad,"
                "sigma_theta_rad,sigma_phi_rad,sigma_psi_rad,quality\n"),
      std::string::npos);
  for (TrackSample& sample : file.tracks[0].samples) {
    sample.theta.reset();
    sample.psi.reset();
  }
  write_track(file, folder / "plain.csv");
  const std::string text = content(folder / "plain.csv");
  EXPECT_EQ(text.rfind("# trochoid track 1\n", 0), 0u);
  EXPECT_NE(text.find("\nframe,t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2,x_px,y_px,quality\n"),
            std::string::npos);
}

TEST(TrackFile, KeepsSeveralBodiesApartByTheLastColumn) {
  const TestFolder folder;
  TrackFile file = full_file();
  Track second = file.tracks[0];
  second.object = 1;
  second.samples.erase(second.samples.begin());
  file.tracks.push_back(second);
  write_track(file, folder / "two.csv");
  EXPECT_NE(content(folder / "two.csv").find("quality,object\n0,"), std::string::npos);
  const TrackFile read = read_track(folder / "two.csv");
  ASSERT_EQ(read.tracks.size(), 2u);
  expect_same(read.tracks[0], file.tracks[0]);
  expect_same(read.tracks[1], file.tracks[1]);
}

TEST(TrackFile, OfAnotherToolNeedsOnlyTimeAndPlace) {
  const TestFolder folder;
  const TrackFile read =
      read_track(folder.write("bare.csv", "t_s,x_m,y_m\n0,0.1,0.2\n0.01,+0.11,2.1e-1\n"));
  ASSERT_EQ(read.tracks.at(0).samples.size(), 2u);
  const TrackSample& sample = read.tracks[0].samples[1];
  EXPECT_EQ(sample.frame, -1);
  EXPECT_EQ(sample.centre_m, Eigen::Vector2d(0.11, 0.21));
  EXPECT_FALSE(sample.has_covariance());
}

TEST(TrackFile, PassesOverAnglesWhoseFileHasNoSigmas) {
  const TestFolder folder;
  const TrackFile read =
      read_track(folder.write("trajectory.csv", "t_s,theta_rad,x_m,y_m\n0,0.5,0.1,0.2\n"));
  EXPECT_FALSE(read.tracks.at(0).samples.at(0).theta);
}

TEST(TrackFile, InPixelsOnlyHasNoMetres) {
  const TestFolder folder;
  const TrackFile read =
      read_track(folder.write("px.csv", "frame,t_s,x_m,y_m,x_px,y_px\n0,0,,,10,20\n"));
  EXPECT_FALSE(read.tracks.at(0).samples.at(0).has_metres());
  EXPECT_EQ(read.tracks[0].samples[0].centre_px, Eigen::Vector2d(10, 20));
}

TEST(TrackFile, FromASpreadsheetMayHaveCarriageReturnsBlanksAByteOrderMarkAndFurtherColumns) {
  const TestFolder folder;
  const TrackFile read = read_track(folder.write(
      "crlf.csv",
      "\xEF\xBB\xBF# exported by hand\r\ny_m , x_m,t_s,comment\r\n\r\n 2 ,1 ,0, 7\r\n4,3,1,\r\n"));
  ASSERT_EQ(read.tracks.at(0).samples.size(), 2u);
  EXPECT_EQ(read.tracks[0].samples[1].centre_m, Eigen::Vector2d(3, 4));
  EXPECT_EQ(read.notes, std::vector<std::string>{"exported by hand"});
}

TEST(TrackFile, SavedByASpreadsheetMayHaveCommasBehindItsRemarks) {
  const TestFolder folder;
  const TrackFile read = read_track(folder.write(
      "filled.csv", "# trochoid track 1,,\n# source: clip.mp4,,\nt_s,x_m,y_m\n0,1,2\n1,3,4\n"));
  EXPECT_EQ(read.source, "clip.mp4");
  EXPECT_EQ(read.tracks.at(0).samples.size(), 2u);
}

TEST(TrackFile, SavedByASpreadsheetMayHaveQuotesRoundItsCellsAndEmptyRows) {
  const TestFolder folder;
  const TrackFile file =
      read_track(folder.write("quoted.csv",
                              "\"# source: made by Anna, by hand\",,\n\"t_s\",\"x_m\",\"y_m\"\n"
                              "\"0\",1,2\n0.5,\"3\",4\n,,\n,,\n"));
  EXPECT_EQ(file.source, "made by Anna, by hand");
  ASSERT_EQ(file.tracks.at(0).samples.size(), 2U);
  EXPECT_EQ(file.tracks[0].samples[1].centre_m, Eigen::Vector2d(3, 4));
}

// Where commas are decimal, spreadsheets separate by semicolons, or by tabs.
TEST(TrackFile, MayHaveDecimalCommasWhereSemicolonsOrTabsSeparate) {
  const TestFolder folder;
  for (const char separator : {';', '\t'}) {
    std::string text =
        "# source: made by Anna, by "
        "hand;;;\n\"t_s\";x_m;y_m;quality\n0;1,5;-2e-1;\n0,5;3;4,25;1\n;;;\n";
    std::replace(text.begin() + text.find('\n'), text.end(), ';', separator);
    const TrackFile file = read_track(folder.write("european.csv", text));
    EXPECT_EQ(file.source, "made by Anna, by hand");
    const auto& samples = file.tracks.at(0).samples;
    ASSERT_EQ(samples.size(), 2U);
    EXPECT_EQ(samples[0].centre_m, Eigen::Vector2d(1.5, -0.2));
    EXPECT_TRUE(std::isnan(samples[0].quality));
    EXPECT_EQ(samples[1].t_s, 0.5);
    EXPECT_EQ(samples[1].centre_m, Eigen::Vector2d(3, 4.25));
  }
  const TrackFile points = read_track(folder.write("points.csv", "t_s;x_m;y_m\n0;1.5;2\n"));
  EXPECT_EQ(points.tracks.at(0).samples[0].centre_m, Eigen::Vector2d(1.5, 2));
}

TEST(TrackFile, MayEndItsRowsInSeparatorsAsItsNamesDo) {
  const TestFolder folder;
  for (const char* rows : {"0,1,2,,\n1,3,4,,\n", "0,1,2\n1,3,4,\n,,,,\n"}) {
    const TrackFile file =
        read_track(folder.write("trailing.csv", std::string("t_s,x_m,y_m,,\n") + rows));
    ASSERT_EQ(file.tracks.at(0).samples.size(), 2U);
    EXPECT_EQ(file.tracks[0].samples[1].centre_m, Eigen::Vector2d(3, 4));
  }
}

TEST(TrackFile, LeavesOutAndCountsTheRowsThatGiveNoPosition) {
  const TestFolder folder;
  const TrackFile file = read_track(
      folder.write("seen_late.csv", "t_s,x_m,y_m\n0,nan,NaN\n0.1,,\n0.2,1,2\n0.4,3,4\n"));
  ASSERT_EQ(file.tracks.at(0).samples.size(), 2U);
  EXPECT_EQ(file.tracks[0].samples[0].t_s, 0.2);
  EXPECT_EQ(file.notes,
            std::vector<std::string>{"2 of 4 rows give no position and are left out: gaps"});
}

TEST(TrackFile, MayHaveLinesThatEndInCarriageReturnsAlone) {
  const TestFolder folder;
  const TrackFile read =
      read_track(folder.write("cr.csv", "# by hand\rt_s,x_m,y_m\r0,1,2\r1,3,4\r"));
  ASSERT_EQ(read.tracks.at(0).samples.size(), 2u);
  EXPECT_EQ(read.tracks[0].samples[1].centre_m, Eigen::Vector2d(3, 4));
  const auto bad = folder.write("bad.csv", "t_s,x_m,y_m\r0,1,2\r0,3,4\r");
  EXPECT_NE(refusal([&] { static_cast<void>(read_track(bad)); }).find("bad.csv:3: "),
            std::string::npos);
}

// Two bodies may share a frame, one may not be in it twice.
TEST(TrackFile, CountsTheFramesOfEachBodyByThemselves) {
  const TestFolder folder;
  const TrackFile read = read_track(folder.write(
      "two.csv", "frame,t_s,x_m,y_m,object\n0,0,1,2,0\n0,0,3,4,1\n1,1,1,2,0\n1,1,3,4,1\n"));
  EXPECT_EQ(read.tracks.size(), 2u);
}

struct CommaPoint : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

// The C locale matters to strtod and printf, the C++ one to streams; neither may reach a file.
TEST(TrackFile, ReadsAndWritesTheSameInALocaleWithDecimalCommas) {
  const TestFolder folder;
  const TrackFile file = full_file();
  write_track(file, folder / "plain.csv");
  std::setlocale(LC_ALL, "de_DE.UTF-8");  // where the machine has it
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaPoint));
  write_track(file, folder / "comma.csv");
  const TrackFile read = read_track(folder / "comma.csv");
  std::locale::global(before);
  std::setlocale(LC_ALL, "C");
  EXPECT_EQ(content(folder / "comma.csv"), content(folder / "plain.csv"));
  expect_same(read.tracks.at(0), file.tracks[0]);
}

struct RefusedTrack {
  const char* name;
  std::string text;
  const char* place;   ///< after the path
  const char* reason;  ///< somewhere in the message
};
class TrackRefusal : public testing::TestWithParam<RefusedTrack> {};

TEST_P(TrackRefusal, NamesFileLineAndReason) {
  const TestFolder folder;
  const auto path = folder.write("bad.csv", GetParam().text);
  const std::string message = refusal([&] { static_cast<void>(read_track(path)); });
  EXPECT_EQ(message.rfind(path.string() + GetParam().place, 0), 0u) << message;
  EXPECT_NE(message.find(GetParam().reason), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    Files, TrackRefusal,
    testing::Values(
        RefusedTrack{"Empty", "", ":", "empty"},
        RefusedTrack{"HeaderOnly", "# trochoid track 1\n", ":", "no column names"},
        RefusedTrack{"NoRows", "t_s,x_m,y_m\n", ":", "no samples"},
        RefusedTrack{"NoColumnNames", "0,1,2\n1,2,3\n", ":1:", "first line must name the columns"},
        RefusedTrack{"NoPlace", "t_s,z_m\n0,1\n", ":1:", "needs t_s,x_m,y_m"},
        RefusedTrack{"SemicolonsInRowsAlone", "t_s,x_m,y_m\n0;1;2\n",
                     ":2:", "1 cells where the header"},
        RefusedTrack{"ThousandsComma", "t_s;x_m;y_m\n0;0.5;1,234\n",
                     ":2:", "'1,234' has a decimal comma where numbers before it have a point"},
        RefusedTrack{"ThousandsPoint", "t_s;x_m;y_m\n0;1;1.234,5\n", ":2:", "not a finite number"},
        RefusedTrack{"DoubledColumn", "t_s,x_m,y_m,x_m\n0,1,2,3\n", ":1:", "twice"},
        RefusedTrack{"NamelessColumn", "t_s,,x_m,y_m\n0,1,2,3\n", ":1:", "column 2 has no name"},
        RefusedTrack{"NumberUnderNoName", "t_s,x_m,y_m,\n0,1,2,3\n",
                     ":2:", "4 cells where the header names 3"},
        RefusedTrack{"SeparatorsBehindARowAlone", "t_s,x_m,y_m\n0,1,2,\n",
                     ":2:", "4 cells where the header names 3"},
        RefusedTrack{"Unsorted", "t_s,x_m,y_m\n0.25,1,2\n0.20,1,2\n",
                     ":3:", "t_s = 0.2 does not increase (previous 0.25); sort the track"},
        RefusedTrack{"SameTimeTwice", "t_s,x_m,y_m\n0.25,1,2\n0.25,1,2\n",
                     ":3:", "(previous 0.25); leave one of the rows out, or write times with"},
        RefusedTrack{"EqualTimes", "t_s,x_m,y_m\n1,1,2\n1,1,2\n", ":3:", "does not increase"},
        RefusedTrack{"NaN", "t_s,x_m,y_m\n0,nan,2\n", ":2:", "x_m = 'nan' is not a finite number"},
        RefusedTrack{"Infinity", "t_s,x_m,y_m\n0,1,-inf\n", ":2:", "y_m = '-inf'"},
        RefusedTrack{"Overflow", "t_s,x_m,y_m\n0,1,1e999\n", ":2:", "not a finite number"},
        RefusedTrack{"Words", "t_s,x_m,y_m\n0,1,hello\n", ":2:", "'hello'"},
        RefusedTrack{"HalfNumber", "t_s,x_m,y_m\n0,1,2.5mm\n", ":2:", "'2.5mm'"},
        RefusedTrack{"Hexadecimal", "t_s,x_m,y_m\n0,1,0x10\n", ":2:", "'0x10'"},
        RefusedTrack{
            "DecimalComma", "t_s,x_m,y_m\n0,1,2,5\n", ":2:",
            "4 cells where the header names 3 columns; if its numbers have decimal commas, "
            "separate the cells, their names too, by semicolons"},
        RefusedTrack{"ShortRow", "t_s,x_m,y_m\n0,1,2\n1,2\n",
                     ":3:", "2 cells where the header names 3"},
        RefusedTrack{"NoTime", "t_s,x_m,y_m\n,1,2\n", ":2:", "t_s is empty"},
        RefusedTrack{"NoPlaceInAnyRow", "t_s,x_m,y_m\n0,,\n1,nan,NaN\n", ":",
                     "no row gives a position"},
        RefusedTrack{"HalfPlace", "t_s,x_m,y_m,x_px,y_px\n0,1,,5,6\n",
                     ":2:", "x_m is given without y_m"},
        RefusedTrack{"HalfPlaceAlone", "t_s,x_m,y_m\n0,,2\n", ":2:", "y_m is given without x_m"},
        RefusedTrack{"HalfCovariance", "t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2\n0,1,2,1e-9,,1e-9\n",
                     ":2:", "sxx_m2,sxy_m2,syy_m2"},
        RefusedTrack{"NegativeVariance", "t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2\n0,1,2,-1,0,1\n",
                     ":2:", "sxx_m2, syy_m2 > 0"},
        RefusedTrack{"TooCorrelated", "t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2\n0,1,2,1,1.5,1\n",
                     ":2:", "no covariance"},
        RefusedTrack{"QuotedNames", "'t_s','x_m','y_m'\n0,1,2\n", ":1:", "remove the quotes"},
        RefusedTrack{"AngleWithoutSigma", "t_s,x_m,y_m,theta_rad,sigma_theta_rad\n0,1,2,0.5,\n",
                     ":2:", "sigma_theta_rad"},
        RefusedTrack{"Degrees", "t_s,x_m,y_m,theta_rad,sigma_theta_rad\n0,1,2,57,0.1\n",
                     ":2:", "theta_rad = 57 is no tilt"},
        RefusedTrack{"NegativeSigma", "t_s,x_m,y_m,phi_rad,sigma_phi_rad\n0,1,2,0.5,-1\n",
                     ":2:", "sigma_phi_rad = -1"},
        RefusedTrack{"Quality", "t_s,x_m,y_m,quality\n0,1,2,1.5\n", ":2:", "0..1"},
        RefusedTrack{"BrokenFrame", "frame,t_s,x_m,y_m\n1.5,0,1,2\n", ":2:", "whole number"},
        RefusedTrack{"NegativeFrame", "frame,t_s,x_m,y_m\n-4,0,1,2\n", ":2:", "whole number"},
        RefusedTrack{"DoubledFrame", "frame,t_s,x_m,y_m\n7,0,1,2\n8,1,1,2\n8,2,1,2\n",
                     ":4:", "frame = 8 does not increase (previous 8)"},
        RefusedTrack{"NoObject", "t_s,x_m,y_m,object\n0,1,2,\n", ":2:", "object = ''"},
        RefusedTrack{"HugeObject", "t_s,x_m,y_m,object\n0,1,2,1e300\n", ":2:", "whole number"},
        RefusedTrack{"FutureVersion", "# trochoid track 2\nt_s,x_m,y_m\n0,1,2\n", ":", "version 1"},
        RefusedTrack{"OtherUnits", "# units: ms, mm\nt_s,x_m,y_m\n0,1,2\n", ":", "'ms, mm'"},
        RefusedTrack{"Nul", std::string("t_s,x_m,y_m\n0,1,\0\x01\n", 19), ":2:", "'?\?'"},
        RefusedTrack{"BinaryNoise", std::string("\x89PNG\r\n\x1a\n\0\0\0", 11), ":1:", "column"},
        RefusedTrack{"HugeLine", "t_s,x_m,y_m\n" + std::string(3'000'000, '9') + ",1,2\n",
                     ":2:", "..."},
        RefusedTrack{"ManyCommas", "t_s,x_m,y_m\n" + std::string(2'000'000, ',') + "\n",
                     ":2:", "too many cells"},
        RefusedTrack{"ManyColumns", std::string(2'000'000, ','), ":1:", "columns"}),
    [](const auto& instance) { return instance.param.name; });

TEST(TrackFile, HeaderClaimingABillionRowsCostsNothing) {
  const TestFolder folder;
  const TrackFile read =
      read_track(folder.write("claim.csv", "# rows: 1000000000\nt_s,x_m,y_m\n0,1,2\n"));
  EXPECT_EQ(read.tracks.at(0).samples.size(), 1u);
}

TEST(TrackFile, MissingOrAFolderIsRefused) {
  const TestFolder folder;
  EXPECT_NE(refusal([&] { static_cast<void>(read_track(folder / "no.csv")); }).find("no such file"),
            std::string::npos);
  EXPECT_NE(refusal([&] { static_cast<void>(read_track(folder.path())); }).find("folder"),
            std::string::npos);
}

TEST(TrackFile, ThatCouldNotBeReadAgainIsNotWritten) {
  const TestFolder folder;
  TrackFile file = full_file();
  file.tracks[0].samples[2].t_s = -1.0;
  static_cast<void>(refusal([&] { write_track(file, folder / "t.csv"); }));
  file.tracks[0].samples.clear();
  static_cast<void>(refusal([&] { write_track(file, folder / "t.csv"); }));
  EXPECT_EQ(folder.entries(), 0);
}

TEST(TrackFile, KeepsLineBreaksInTextFromBreakingTheHeader) {
  const TestFolder folder;
  TrackFile file = full_file();
  file.source = "two\nlines.mp4";
  write_track(file, folder / "t.csv");
  EXPECT_EQ(read_track(folder / "t.csv").source, "two lines.mp4");
}

}  // namespace
}  // namespace trochoid::data
