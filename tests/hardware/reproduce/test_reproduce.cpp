// SPDX-License-Identifier: BSD-3-Clause
// The pages of scripts/reproduce.sh: nothing of a paper is left out, every picture is there, every
// promised number is one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using Row = std::vector<std::string>;

const std::string output = ICAT_OUTPUT, source = ICAT_SOURCE;

std::string bytes(const fs::path& file) {
  std::ifstream in(file);
  std::stringstream all;
  all << in.rdbuf();
  return all.str();
}
/// What the script answers; what it says goes to a file.
int script(const std::string& words) {
  fs::create_directories(output);
  const std::string command = "ICAT_EXAMPLES='" ICAT_PROGRAMS "' ICAT_OUTPUT='" + output + "' '" +
                              source + "/scripts/reproduce.sh' " + words + " > '" + output +
                              "/said.txt' 2>&1";
  return std::system(command.c_str());
}
bool digit(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return std::isdigit(c) != 0; });
}

/// A Markdown table.
struct Table {
  Row columns;
  std::vector<Row> rows;
  /// −1: there is none of this name.
  int column(const std::string& name) const {
    const auto at = std::find(columns.begin(), columns.end(), name);
    return at == columns.end() ? -1 : static_cast<int>(at - columns.begin());
  }
};
Row cells(const std::string& line) {
  Row row;
  std::string cell;
  for (std::size_t i = 2; i < line.size(); ++i) {
    if (line[i] == '|') {
      row.push_back(cell.substr(0, cell.empty() ? 0 : cell.size() - 1));
      cell.clear();
      ++i;  // the space after it
    } else {
      cell += line[i];
    }
  }
  return row;
}

/// What the script has written of one paper.
struct Page {
  explicit Page(const std::string& paper) : folder(output + "/" + paper) {
    text = bytes(folder / ("reproduce_" + paper + ".md"));
    std::istringstream lines(text);
    std::string line;
    bool inside = false;
    while (std::getline(lines, line)) {
      if (line.empty() || line[0] != '|') {
        inside = false;
      } else if (!inside) {
        tables.push_back({cells(line), {}});
        inside = true;
      } else if (line[1] != '-') {
        tables.back().rows.push_back(cells(line));
      }
    }
  }
  /// Links and pictures, "](here)".
  std::vector<std::string> links() const {
    std::vector<std::string> all;
    const std::regex link(R"(\]\(([^)#]+)[^)]*\))");
    for (std::sregex_iterator i(text.begin(), text.end(), link), end; i != end; ++i) {
      all.push_back((*i)[1]);
    }
    return all;
  }
  /// A picture whose caption begins with "Fig. <number>", or "Fig. 3 and <number>".
  bool has_picture_of(int number) const {
    const std::string n = std::to_string(number);
    const std::regex caption(R"(!\[(Fig\. [^\]]*)\]\()");
    const std::regex mine("(Fig\\. |and )" + n + "(\\D|$)");
    for (std::sregex_iterator i(text.begin(), text.end(), caption), end; i != end; ++i) {
      const std::string words = (*i)[1];
      if (std::regex_search(words, mine)) return true;
    }
    return false;
  }
  /// The parts of each figure that have a row: 4 → "abcdef", or "" where it has no parts.
  std::map<int, std::string> figures() const {
    std::map<int, std::string> all;
    const std::regex name(R"(Fig\. (\d+)([a-z]?)( to \d+([a-z]))?(, \d+([a-z]))?)");
    for (const Table& t : tables) {
      if (t.column("figure") != 0) continue;
      for (const Row& row : t.rows) {
        std::smatch m;
        if (!std::regex_match(row[0], m, name)) {
          ADD_FAILURE() << "no name of a figure: " << row[0];
          continue;
        }
        std::string& parts = all[std::stoi(m[1])];
        parts += m[2];
        if (m[4].matched) {
          for (char c = m[2].str()[0]; c++ < m[4].str()[0];) parts += c;
        }
        parts += m[6];
      }
    }
    return all;
  }

  fs::path folder;
  std::string text;
  std::vector<Table> tables;
};

/// Of every paper.
void check(const Page& page, const std::map<int, std::string>& figures, int published_tables) {
  EXPECT_EQ(page.figures(), figures);
  const char* roman[] = {"I", "II", "III"};
  for (int k = 0; k < published_tables; ++k) {
    EXPECT_NE(page.text.find(std::string("## Table ") + roman[k] + ":"), std::string::npos) << k;
  }
  for (const std::string& link : page.links()) {
    EXPECT_TRUE(fs::exists(page.folder / link)) << link;
  }
  int promised = 0;
  for (const Table& t : page.tables) {
    const int here = t.column("here"), why = static_cast<int>(t.columns.size()) - 1;
    EXPECT_FALSE(t.rows.empty());
    for (const Row& row : t.rows) {
      ASSERT_EQ(row.size(), t.columns.size()) << row[0];
      if (here < 0) continue;
      const std::string& got = row[static_cast<std::size_t>(here)];
      if (got == "not reproduced") {
        EXPECT_GT(row[static_cast<std::size_t>(why)].size(), 10U) << row[0] << ": why?";
        continue;
      }
      ++promised;
      EXPECT_TRUE(digit(got) || got.find("picture") != std::string::npos) << row[0] << ": " << got;
      EXPECT_EQ(got.find("nan"), std::string::npos) << row[0];
      if (got.find("picture below") != std::string::npos) {
        EXPECT_TRUE(page.has_picture_of(std::stoi(row[0].substr(5)))) << row[0];
      }
    }
  }
  EXPECT_GT(promised, 10);
}

/// Without numbers, which compilers and attempts change, and without the way to docs/.
std::string words(std::string line) {
  line = std::regex_replace(line, std::regex(R"(\]\([^)]*docs/)"), "](");
  return std::regex_replace(line, std::regex(R"((×|[-+])? ?\d+(\.\d+)?(e[-+]?\d+)?( %)?)"), "n");
}
/// The page in docs/ says the same, line by line.
void compare_with_docs(const Page& page, const std::string& paper) {
  std::istringstream here(page.text), there(bytes(source + "/docs/reproduce_" + paper + ".md"));
  std::string a, b;
  while (std::getline(here, a)) {
    ASSERT_TRUE(std::getline(there, b)) << "docs/ does not have: " << a;
    EXPECT_EQ(words(a), words(b));
  }
  EXPECT_FALSE(std::getline(there, b)) << "in docs/ alone: " << b;
}

TEST(Reproduce, AnUnknownPaperIsToldWhichThereAre) {
  for (const char* words : {"", "coups", "maris none", "maris 0"}) {
    EXPECT_NE(script(words), 0) << words;
    const std::string said = bytes(output + "/said.txt");
    if (std::string(words).find("maris") == std::string::npos) {
      EXPECT_NE(said.find("coop, nsb and maris"), std::string::npos) << said;
    } else {
      EXPECT_NE(said.find("a number > 0"), std::string::npos) << said;
    }
  }
}

TEST(Reproduce, Coop) {
  ASSERT_EQ(script("coop"), 0) << bytes(output + "/said.txt");
  const Page page("coop");
  check(page, {{1, ""}, {2, ""}, {3, ""}, {4, "abcdef"}, {5, "abcdef"}, {6, ""}, {7, ""}, {8, ""}},
        3);
  compare_with_docs(page, "coop");
  // Tables I and III: nine tasks in seven phases, eleven tests with seven numbers.
  int found = 0;
  for (const Table& t : page.tables) {
    const bool first = t.column("task") == 0, third = t.column("test") == 0;
    if (!first && !third) continue;
    ++found;
    EXPECT_EQ(t.rows.size(), first ? 9U : 11U);
    for (const Row& row : t.rows) {
      for (std::size_t k = 1; k < 8; ++k) EXPECT_TRUE(digit(row[k])) << row[0];
    }
  }
  EXPECT_EQ(found, 2);
}

TEST(Reproduce, Nsb) {
  ASSERT_EQ(script("nsb"), 0) << bytes(output + "/said.txt");
  const Page page("nsb");
  check(page, {{1, ""}, {2, ""}, {3, ""}, {4, "abcd"}, {5, "ab"}}, 0);
  compare_with_docs(page, "nsb");

  // Where a program does not print what is promised there is no page.
  const fs::path less = output + "/less";
  fs::remove_all(less);
  fs::copy(page.folder, less, fs::copy_options::recursive);
  fs::remove(less / "reproduce_nsb.md");
  const fs::path report = less / "03_nsb_dual_arm/report.txt";
  std::string text = bytes(report);
  const std::size_t at = text.find("  field of view");
  ASSERT_NE(at, std::string::npos);
  std::ofstream(report) << text.erase(at, text.find('\n', at) - at);
  const std::string program = "python3 -B '" + source + "/scripts/reproduce/nsb.py' '" +
                              less.string() + "' '" + less.string() + "' 2> /dev/null";
  EXPECT_NE(std::system(program.c_str()), 0);
  EXPECT_FALSE(fs::exists(less / "reproduce_nsb.md"));
}

TEST(Reproduce, Maris) {
  fs::remove_all(output + "/maris");
  ASSERT_EQ(script("maris 2"), 0) << bytes(output + "/said.txt");
  const Page page("maris");
  check(page,
        {{1, "ab"},
         {2, ""},
         {3, ""},
         {4, ""},
         {5, "ab"},
         {6, ""},
         {7, "ab"},
         {8, "ab"},
         {9, ""},
         {10, ""},
         {11, "ab"},
         {12, "abc"},
         {13, "abcd"},
         {14, ""},
         {15, ""},
         {16, ""},
         {17, "ab"},
         {18, "ab"},
         {19, ""}},
        1);
  const std::string attempts = bytes(page.folder / "16_maris_campaign/attempts.csv");
  EXPECT_EQ(std::count(attempts.begin(), attempts.end(), '\n'), 1 + 2 * 8);
  // Rates of two attempts are what they are: of docs/ the rows, by their first two cells.
  const std::string docs = bytes(source + "/docs/reproduce_maris.md");
  for (const Table& t : page.tables) {
    for (const Row& row : t.rows) {
      EXPECT_NE(docs.find("| " + row[0] + " | " + row[1] + " |"), std::string::npos) << row[0];
    }
  }
}

}  // namespace
