#include "io/pickle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <random>

#include "core/error.h"
#include "io/npy_internal.h"

namespace sole::io {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using namespace std::string_literals;

/// A dictionary {"a": ...} of protocol 2; `value` are the instructions that make the value.
std::string Dict(const std::string& value) { return "\x80\x02}U\x01\x61"s + value + "s."; }

Npz Parsed(const std::string& pickle) { return ParsePickledArrays(pickle, "file"); }

double Number(const std::string& value) { return MatrixFrom(Parsed(Dict(value)), "a")(0, 0); }

std::string Text(const std::string& value) { return StringFrom(Parsed(Dict(value)), "a"); }

std::string ErrorOf(const std::string& pickle) {
  try {
    Parsed(pickle);
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_TRUE(what.starts_with("file: ")) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    return what;
  }
  return "";
}

std::string Bytes32(const std::string& bytes) {
  std::string op = "B";
  for (int i = 0; i < 4; ++i) op += static_cast<char>(bytes.size() >> (8 * i) & 0xff);
  return op + bytes;
}

/// numpy array of doubles; `shape` are the instructions of its tuple.
std::string Array(const std::string& shape, const std::string& data) {
  return "cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85U\x01\x62\x87R(K\x01"s +
         shape +
         "cnumpy\ndtype\nU\x02\x66\x38K\0K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89"s +
         Bytes32(data) + "tb";
}

TEST(Pickle, NumbersOfEveryInstruction) {
  EXPECT_EQ(Number("I-12\n"), -12);
  EXPECT_EQ(Number("I01\n"), 1);
  EXPECT_EQ(Number("L4294967295L\n"), 4294967295.0);
  EXPECT_EQ(Number("L18446744073709551615L\n"), 18446744073709551615.0);
  EXPECT_EQ(Number("F-2.5e-3\n"), -2.5e-3);
  EXPECT_EQ(Number("J\xfe\xff\xff\xff"), -2);
  EXPECT_EQ(Number("K\xff"), 255);
  EXPECT_EQ(Number("M\x01\x02"), 513);
  EXPECT_EQ(Number("G\xc0\x04\0\0\0\0\0\0"s), -2.5);
  EXPECT_EQ(Number("\x8a\x01\x80"), -128);
  EXPECT_EQ(Number("\x8a\0"s), 0);
  EXPECT_EQ(Number("\x8a\x09\0\0\0\0\0\0\0\0\x01"s), 18446744073709551616.0);
  EXPECT_EQ(Number("\x8a\x09\xff\xff\xff\xff\xff\xff\xff\xff\xff"), -1);
  EXPECT_EQ(Number("\x8b\x02\0\0\0\xff\x7f"s), 32767);
  EXPECT_EQ(Number("\x88"), 1);
  EXPECT_EQ(Number("\x89"), 0);
}

TEST(Pickle, TextOfEveryInstruction) {
  EXPECT_EQ(Text("S'a\\x41\\n\\'\\\\\\101'\n"), "aA\n'\\A");
  EXPECT_EQ(Text("V\\u0041b\xe9\n"), "Ab\xc3\xa9");
  EXPECT_EQ(Text("U\x02hi"), "hi");
  EXPECT_EQ(Text("T\x02\0\0\0hi"s), "hi");
  EXPECT_EQ(Text("X\x02\0\0\0\xc3\xa9"s), "\xc3\xa9");
  EXPECT_EQ(Text("\x8c\x02hi"), "hi");
  EXPECT_EQ(Text("\x8d\x02\0\0\0\0\0\0\0hi"s), "hi");
  EXPECT_EQ(Text("c_codecs\nencode\nX\x02\0\0\0\xc3\xa9X\x06\0\0\0latin1\x86R"s), "\xef\xbf\xbd");
}

TEST(Pickle, ListsTuplesSetsAndMemo) {
  const auto list = [](const std::string& value) { return IntsFrom(Parsed(Dict(value)), "a"); };
  EXPECT_THAT(list("]K\x01\x61K\x02\x61"), ElementsAre(1, 2));
  EXPECT_THAT(list("](K\x01K\x02\x65"), ElementsAre(1, 2));
  EXPECT_THAT(list("(K\x01K\x02l"), ElementsAre(1, 2));
  EXPECT_THAT(list("K\x01K\x02\x86"), ElementsAre(1, 2));
  EXPECT_THAT(list("\x8f(K\x01K\x02\x90"), ElementsAre(1, 2));
  EXPECT_THAT(list("c__builtin__\nset\n](K\x01K\x02\x65\x85R"), ElementsAre(1, 2));
  EXPECT_THAT(list("(K\x07q\x05h\x05K\x03t"), ElementsAre(7, 7, 3));
  EXPECT_THAT(list("(K\x07\x94h\0K\x03t"s), ElementsAre(7, 7, 3));
  EXPECT_THAT(list("K\x09(K\x08\x31\x85"), ElementsAre(9));  // POP_MARK drops the 8
  const Npz nested = Parsed(Dict("(K\x01K\x02\x86K\x03K\x04\x86t"));
  EXPECT_THAT(ShapeOf(nested, "a"), ElementsAre(2, 2));
}

TEST(Pickle, DictionaryWithinBecomesAPath) {
  const Npz arrays = Parsed(Dict("}(U\x01xK\x05U\x01yNK\x03K\x04u"));
  EXPECT_THAT(IntsFrom(arrays, "a/x"), ElementsAre(5));
  EXPECT_EQ(arrays.size(), 1U);  // None and keys that are no text are left out
}

TEST(Pickle, ArrayOfDoubles) {
  const double values[] = {1.5, -2};
  const std::string data(reinterpret_cast<const char*>(values), sizeof values);
  const Npz arrays = Parsed(Dict(Array("K\x01K\x02\x86", data)));
  EXPECT_THAT(ShapeOf(arrays, "a"), ElementsAre(1, 2));
  EXPECT_EQ(MatrixFrom(arrays, "a")(0, 1), -2);
}

TEST(Pickle, ArrayThatDoesNotFitItsDataIsRefused) {
  EXPECT_THAT(ErrorOf(Dict(Array("K\x03\x85", std::string(16, 0)))), HasSubstr("match its shape"));
  EXPECT_THAT(ErrorOf(Dict(Array("J\xff\xff\xff\x7fJ\xff\xff\xff\x7f\x86", std::string(16, 0)))),
              HasSubstr("match its shape"));
  EXPECT_THAT(ErrorOf(Dict(Array("K\x02J\xff\xff\xff\xff\x86", std::string(16, 0)))),
              HasSubstr("impossible shape"));
}

TEST(Pickle, ForeignClassesAreRefusedByName) {
  for (const char* name : {"os\nsystem", "posix\nsystem", "__builtin__\neval", "builtins\nexec",
                           "builtins\ngetattr", "subprocess\nPopen", "numpy\nload",
                           "numpy.testing._private.utils\nruncode", "copy_reg\n_extension_registry",
                           "scipy.sparse.linalg\nspsolve", "numpy.core.multiarray\nfrombuffer"}) {
    std::string dotted(name);
    dotted[dotted.find('\n')] = '.';
    const std::string global = "c"s + name + "\n";
    EXPECT_THAT(ErrorOf(Dict(global + "(S'true'\ntR")), HasSubstr("'" + dotted + "'"));
    EXPECT_THAT(ErrorOf(Dict("(i" + std::string(name) + "\n")), HasSubstr("'" + dotted + "'"));
  }
  EXPECT_THAT(ErrorOf(Dict("\x8c\x02os\x8c\x06system\x93\x8c\x04true\x85R")),
              HasSubstr("'os.system'"));
  EXPECT_THAT(ErrorOf("cos\nsystem\n(S'rm -rf'\ntR."), HasSubstr("'os.system'"));
}

TEST(Pickle, KnownFunctionsTakeOnlyKnownArguments) {
  const std::string way = "unknown way";
  EXPECT_THAT(ErrorOf(Dict("c_codecs\nencode\nX\x01\0\0\0xX\x05\0\0\0rot13\x86R"s)),
              HasSubstr(way));
  EXPECT_THAT(ErrorOf(Dict("c__builtin__\nobject\n)R")), HasSubstr(way));
  EXPECT_THAT(ErrorOf(Dict("c__builtin__\nset\n]]\x86R")), HasSubstr(way));
  EXPECT_THAT(ErrorOf(Dict("cnumpy\nndarray\n)R")), HasSubstr(way));
  EXPECT_THAT(ErrorOf(Dict("cnumpy\ndtype\n)R")), HasSubstr(way));
  EXPECT_THAT(ErrorOf(Dict("cnumpy\ndtype\n)\x81")), HasSubstr("numpy.dtype"));
  EXPECT_THAT(ErrorOf(Dict("K\x01)R")), HasSubstr("no function"));
  EXPECT_THAT(ErrorOf(Dict("S'os.system'\n(S'true'\ntR")), HasSubstr("no function"));
  EXPECT_THAT(ErrorOf(Dict("K\x01)\x81")), HasSubstr("no class"));
  EXPECT_THAT(ErrorOf(Dict("K\x01}b")), HasSubstr("state"));
}

TEST(Pickle, PersistentIdsExtensionsAndBuffersAreRefused) {
  EXPECT_THAT(ErrorOf(Dict("Pname\n")), HasSubstr("persistent"));
  EXPECT_THAT(ErrorOf(Dict("K\x01Q")), HasSubstr("persistent"));
  EXPECT_THAT(ErrorOf(Dict("\x82\x01")), HasSubstr("extension"));
  EXPECT_THAT(ErrorOf(Dict("\x97")), HasSubstr("buffers"));
}

TEST(Pickle, DamageIsRefused) {
  EXPECT_THAT(ErrorOf(Dict("h\x07")), HasSubstr("has not made"));
  EXPECT_THAT(ErrorOf(Dict("00")), HasSubstr("stack is empty"));
  EXPECT_THAT(ErrorOf(Dict("t")), HasSubstr("mark"));
  EXPECT_THAT(ErrorOf(Dict("T\xff\xff\xff\xffx")), HasSubstr("ends too early"));
  EXPECT_THAT(ErrorOf(Dict("\x8e\xff\xff\xff\xff\xff\xff\xff\xffx")), HasSubstr("ends too early"));
  EXPECT_THAT(ErrorOf(Dict("K\x01K\x02\x61")), HasSubstr("holds none"));
  EXPECT_THAT(ErrorOf(Dict("(K\x01\x64")), HasSubstr("value is missing"));
  EXPECT_THAT(ErrorOf("\x80\x09."), HasSubstr("newer than 5"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("ends too early"));
  EXPECT_THAT(ErrorOf("K\x01."), HasSubstr("no dictionary"));
}

TEST(Pickle, NestingAndRepetitionAreBounded) {
  EXPECT_THAT(ErrorOf(Dict("]q\1h\1a")),
              HasSubstr("nested too deeply"));  // a list that holds itself
  std::string doubling = "K\x01q\0"s;           // again and again a pair of the last pair
  for (char i = 0; i < 14; ++i) doubling += "h"s + i + "h" + i + "\x86q" + static_cast<char>(i + 1);
  EXPECT_THAT(ErrorOf(Dict("(" + doubling + "t")), HasSubstr("larger than the file"));
  std::string many = "(";
  for (int i = 0; i < 1100000; ++i) many += ']';
  EXPECT_THAT(ErrorOf(Dict(many + "t")), HasSubstr("million objects"));
  EXPECT_THAT(ErrorOf(Dict("N" + std::string(1100000, '2'))), HasSubstr("million objects"));
  EXPECT_THAT(ErrorOf(Dict("N" + std::string(1100000, '\x94'))), HasSubstr("million objects"));
  EXPECT_THAT(ErrorOf(Dict(std::string(1100000, '('))), HasSubstr("million marks"));
}

TEST(Pickle, AnArrayNamedManyTimesStaysWithinTheBudget) {
  const std::string data(8 * 100000, 1);
  std::string pickle = "\x80\x02}U\x01\x61"s + Array("J\xa0\x86\x01\0\x85"s, data) + "q\1s";
  for (int i = 0; i < 200; ++i)
    pickle +=
        "X\x02\0\0\0"s + static_cast<char>('A' + i % 26) + static_cast<char>('A' + i / 26) + "h\1s";
  EXPECT_THAT(ErrorOf(pickle + "."), HasSubstr("larger than the file"));
}

/// Copies of a good pickle with random bytes changed, and cut at every length.
TEST(Pickle, DamagedCopiesEndInAnErrorOrInArrays) {
  const std::string data(64, 1);
  const std::string sparse =
      "cscipy.sparse.csc\ncsc_matrix\n)\x81}(U\x06_shapeK\x02K\x03\x86U\x04\x64\x61ta]("
      "K\x05K\x06\x65U\x07indices"
      "](K\0K\x01\x65U\x06indptr](K\0K\x01K\x01K\x02\x65ub"s;
  const std::string good =
      "\x80\x02}(U\x01\x61"s + Array("K\x02K\x04\x86", data) + "U\x01s" + sparse +
      "U\x01"
      "cccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\nc__builtin__\nobject\nNtR}U\x01xF2.5\nsb" +
      "U\x01"
      "d}U\x01x](K\x01K\x02\x65su.";
  const Npz whole = Parsed(good);
  EXPECT_EQ(whole.size(), 4U);
  EXPECT_EQ(MatrixFrom(whole, "s")(0, 0), 5);
  EXPECT_EQ(MatrixFrom(whole, "s")(1, 2), 6);
  EXPECT_EQ(MatrixFrom(whole, "c")(0, 0), 2.5);
  for (std::size_t length = 0; length < good.size(); ++length)
    EXPECT_NE(ErrorOf(good.substr(0, length)), "");
  std::mt19937_64 random(23);
  rusage before{}, after{};
  ::getrusage(RUSAGE_SELF, &before);
  int accepted = 0;
  for (int round = 0; round < 40000; ++round) {
    std::string bytes = good;
    for (std::uint64_t i = 0, n = 1 + random() % 4; i < n; ++i) {
      const std::size_t at = random() % bytes.size(), from = random() % good.size();
      if (random() % 4 == 0) {
        bytes.insert(at, good.substr(from, random() % 12));
      } else {
        bytes[at] = random() % 2 ? good[from] : static_cast<char>(random() & 0xff);
      }
    }
    try {
      for (const auto& [name, array] : Parsed(bytes)) {
        EXPECT_EQ(array.bytes.size(), array.Count() * ItemSize(array.dtype)) << name;
      }
      ++accepted;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
  ::getrusage(RUSAGE_SELF, &after);
  EXPECT_GT(accepted, 0);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 512 * 1024);
}

}  // namespace
}  // namespace sole::io
