# Writes OUTPUT, a C++ source that holds the bytes of INPUT as sole::embedded::NAME().
file(READ "${INPUT}" hex HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" bytes "${hex}")
string(LENGTH "${hex}" hex_length)
math(EXPR count "${hex_length} / 2")
# One literal per line of 30 bytes, glued by the compiler.
string(REGEX REPLACE "(........................................................................................................................)" "\\1\"\n    \"" bytes "${bytes}")
file(WRITE "${OUTPUT}" "#include <string_view>

namespace sole::embedded {
std::string_view ${NAME}();
std::string_view ${NAME}() {
  static constexpr char kBytes[] =
    \"${bytes}\";
  return {kBytes, ${count}};
}
}  // namespace sole::embedded
")
