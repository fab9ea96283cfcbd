#include "io/pickle.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <unordered_map>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/pickle_internal.h"
#include "io/shown_internal.h"

namespace sole::io {
namespace {

constexpr std::size_t kMaxEntries = 1'000'000;  ///< of stack, marks and memo

/// Pickle's stack machine over inert objects.
class Machine {
 public:
  Machine(std::string_view bytes, const std::string& where, Pickle& pickle, MemoryBudget& budget)
      : bytes_(bytes), where_(where), pickle_(pickle), objects_(pickle, budget, where_) {
    none_ = pickle_.Add(PickleKind::kNone, where_);
    for (const bool value : {false, true}) {
      booleans_[value] = pickle_.Add(PickleKind::kBool, where_);
      booleans_[value]->integer = value;
    }
  }

  void Run() {
    for (;;) {
      const char op = Take(1)[0];
      if (op == '.') break;
      if (!Number(op) && !Text(op) && !Collection(op) && !Memo(op) && !Object(op)) Unknown(op);
    }
    pickle_.root = Pop();
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw Error(where_ + ": damaged pickle at byte " + std::to_string(at_) + ": " + what);
  }
  [[noreturn]] void Unknown(char op) const {
    if (op == 'P' || op == 'Q') Fail("persistent ids are refused");
    if (op >= '\x82' && op <= '\x84') Fail("extension codes are refused");
    if (op == '\x97' || op == '\x98') Fail("buffers outside the file are refused");
    Fail("unknown instruction " + std::to_string(static_cast<unsigned char>(op)));
  }

  std::string_view Take(std::size_t count) {
    if (count > bytes_.size() - at_) Fail("it ends too early");
    const std::string_view taken = bytes_.substr(at_, count);
    at_ += count;
    return taken;
  }
  template <typename T>
  T Little() {
    return LoadLittle<T>(Take(sizeof(T)).data());
  }
  std::string_view Line() {
    const std::size_t end = bytes_.find('\n', at_);
    if (end == std::string_view::npos) Fail("it ends too early");
    const std::string_view line = Take(end - at_);
    Take(1);
    return line;
  }

  void Push(PickleNode* node) {
    if (stack_.size() >= kMaxEntries) Fail("its stack grows beyond a million objects");
    stack_.push_back(node);
  }
  void Remember(std::uint64_t key) {
    if (memo_.size() >= kMaxEntries) Fail("it names more than a million objects");
    memo_[key] = Top();
  }
  std::size_t Floor() const { return marks_.empty() ? 0 : marks_.back(); }
  PickleNode* Top() const {
    if (stack_.size() <= Floor()) Fail("its stack is empty");
    return stack_.back();
  }
  PickleNode* Pop() {
    PickleNode* top = Top();
    stack_.pop_back();
    return top;
  }
  std::vector<PickleNode*> PopToMark() {
    if (marks_.empty()) Fail("a mark is missing");
    const auto begin = stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back());
    std::vector<PickleNode*> items(begin, stack_.end());
    stack_.erase(begin, stack_.end());
    marks_.pop_back();
    return items;
  }
  std::vector<PickleNode*> PopSome(std::size_t count) {
    std::vector<PickleNode*> items(count);
    for (std::size_t i = count; i-- > 0;) items[i] = Pop();
    return items;
  }

  void PushInteger(std::int64_t value) {
    Push(pickle_.Add(PickleKind::kInt, where_));
    Top()->integer = value;
  }
  void PushReal(double value) {
    Push(pickle_.Add(PickleKind::kReal, where_));
    Top()->real = value;
  }
  void PushText(PickleKind kind, std::string text) {
    Push(pickle_.Add(kind, where_));
    Top()->text = std::move(text);
  }
  void PushItems(PickleKind kind, std::vector<PickleNode*> items) {
    if (kind == PickleKind::kDict && items.size() % 2 != 0) Fail("a value is missing");
    Push(pickle_.Add(kind, where_));
    Top()->items = std::move(items);
  }

  void PushDecimal(std::string_view text) {
    std::int64_t value = 0;
    const char* end = text.data() + text.size();
    const auto [stop, code] = std::from_chars(text.data(), end, value);
    if (code == std::errc() && stop == end) {
      PushInteger(value);
      return;
    }
    double real = 0;
    const auto [real_stop, real_code] = std::from_chars(text.data(), end, real);
    if (real_code == std::errc::invalid_argument || real_stop != end) Fail("a number is expected");
    PushReal(real);
  }
  /// Little-endian two's complement of any length.
  void PushLong(std::string_view bytes) {
    const bool negative = !bytes.empty() && (bytes.back() & 0x80) != 0;
    if (bytes.size() <= 8) {
      std::uint64_t value = negative ? ~std::uint64_t{0} : 0;
      for (std::size_t i = bytes.size(); i-- > 0;)
        value = value << 8 | static_cast<unsigned char>(bytes[i]);
      PushInteger(static_cast<std::int64_t>(value));
      return;
    }
    double value = negative ? -1 : 0;
    for (std::size_t i = bytes.size(); i-- > 0;)
      value = value * 256 + static_cast<unsigned char>(bytes[i]);
    PushReal(value);
  }

  bool Number(char op) {
    switch (op) {
      case 'N':
        Push(none_);
        return true;
      case '\x88':
      case '\x89':
        Push(booleans_[op == '\x88']);
        return true;
      case 'I': {
        const std::string_view line = Line();
        if (line == "00" || line == "01") {
          Push(booleans_[line == "01"]);
        } else {
          PushDecimal(line);
        }
        return true;
      }
      case 'L': {
        std::string_view line = Line();
        if (line.ends_with('L')) line.remove_suffix(1);
        PushDecimal(line);
        return true;
      }
      case 'F': {
        const std::string_view line = Line();
        double value = 0;
        const auto [stop, code] = std::from_chars(line.data(), line.data() + line.size(), value);
        if (code == std::errc::invalid_argument || stop != line.data() + line.size())
          Fail("a number is expected");
        PushReal(value);
        return true;
      }
      case 'J':
        PushInteger(Little<std::int32_t>());
        return true;
      case 'K':
        PushInteger(Little<std::uint8_t>());
        return true;
      case 'M':
        PushInteger(Little<std::uint16_t>());
        return true;
      case 'G':
        PushReal(std::bit_cast<double>(__builtin_bswap64(Little<std::uint64_t>())));
        return true;
      case '\x8a':
        PushLong(Take(Little<std::uint8_t>()));
        return true;
      case '\x8b':
        PushLong(Take(Little<std::uint32_t>()));
        return true;
      default:
        return false;
    }
  }

  bool Text(char op) {
    constexpr auto kBytes = PickleKind::kBytes, kText = PickleKind::kText;
    switch (op) {
      case 'S':
        PushText(kBytes, Unquoted(Line()));
        return true;
      case 'V':
        PushText(kText, Unescaped(Line()));
        return true;
      case 'U':
      case 'C':
        PushText(kBytes, std::string(Take(Little<std::uint8_t>())));
        return true;
      case 'T':
      case 'B':
        PushText(kBytes, std::string(Take(Little<std::uint32_t>())));
        return true;
      case '\x8e':
      case '\x96':
        PushText(kBytes, std::string(Take(Little<std::uint64_t>())));
        return true;
      case '\x8c':
        PushText(kText, std::string(Take(Little<std::uint8_t>())));
        return true;
      case 'X':
        PushText(kText, std::string(Take(Little<std::uint32_t>())));
        return true;
      case '\x8d':
        PushText(kText, std::string(Take(Little<std::uint64_t>())));
        return true;
      default:
        return false;
    }
  }

  void Extend(PickleKind kind, const std::vector<PickleNode*>& items) {
    PickleNode* to = Top();
    if (to->kind != kind) Fail("items are put into something that holds none");
    if (kind == PickleKind::kDict && items.size() % 2 != 0) Fail("a value is missing");
    to->items.insert(to->items.end(), items.begin(), items.end());
  }

  bool Collection(char op) {
    constexpr auto kList = PickleKind::kList, kDict = PickleKind::kDict;
    switch (op) {
      case '(':
        if (marks_.size() >= kMaxEntries) Fail("it has more than a million marks");
        marks_.push_back(stack_.size());
        return true;
      case ']':
      case ')':
      case '\x8f':
        PushItems(kList, {});
        return true;
      case '}':
        PushItems(kDict, {});
        return true;
      case 'l':
      case 't':
      case '\x91':
        PushItems(kList, PopToMark());
        return true;
      case 'd':
        PushItems(kDict, PopToMark());
        return true;
      case '\x85':
      case '\x86':
      case '\x87':
        PushItems(kList, PopSome(static_cast<std::size_t>(op - '\x84')));
        return true;
      case 'a':
        Extend(kList, PopSome(1));
        return true;
      case 's':
        Extend(kDict, PopSome(2));
        return true;
      case 'e':
      case '\x90':
        Extend(kList, PopToMark());
        return true;
      case 'u':
        Extend(kDict, PopToMark());
        return true;
      default:
        return false;
    }
  }

  void Get(std::uint64_t key) {
    const auto found = memo_.find(key);
    if (found == memo_.end()) Fail("it names an object that it has not made");
    Push(found->second);
  }
  std::uint64_t Key() {
    const std::string_view line = Line();
    std::uint64_t key = 0;
    const auto [stop, code] = std::from_chars(line.data(), line.data() + line.size(), key);
    if (code != std::errc() || stop != line.data() + line.size()) Fail("a number is expected");
    return key;
  }

  bool Memo(char op) {
    switch (op) {
      case 'p':
        Remember(Key());
        return true;
      case 'q':
        Remember(Little<std::uint8_t>());
        return true;
      case 'r':
        Remember(Little<std::uint32_t>());
        return true;
      case '\x94':
        Remember(memo_.size());
        return true;
      case 'g':
        Get(Key());
        return true;
      case 'h':
        Get(Little<std::uint8_t>());
        return true;
      case 'j':
        Get(Little<std::uint32_t>());
        return true;
      case '0':
        if (!marks_.empty() && stack_.size() == marks_.back()) {
          marks_.pop_back();
        } else {
          Pop();
        }
        return true;
      case '1':
        PopToMark();
        return true;
      case '2':
        Push(Top());
        return true;
      case '\x80':
        if (Little<std::uint8_t>() > 5) Fail("its protocol is newer than 5");
        return true;
      case '\x95':
        Take(8);
        return true;
      default:
        return false;
    }
  }

  bool Object(char op) {
    switch (op) {
      case 'c':
      case 'i': {
        const std::string module(Line()), name(Line());
        PickleNode* type = objects_.Class(module + "." + name);
        if (op == 'i') PopToMark();
        Push(op == 'c' ? type : objects_.New(*type));
        return true;
      }
      case '\x93': {
        const PickleNode *name = Pop(), *module = Pop();
        if (name->kind != PickleKind::kText || module->kind != PickleKind::kText)
          Fail("a class has no name");
        Push(objects_.Class(module->text + "." + name->text));
        return true;
      }
      case 'o': {
        const std::vector<PickleNode*> items = PopToMark();
        if (items.empty()) Fail("a class is missing");
        Push(objects_.New(*items[0]));
        return true;
      }
      case 'R': {
        const PickleNode *arguments = Pop(), *callable = Pop();
        Push(objects_.Call(*callable, *arguments));
        return true;
      }
      case '\x92':
        Pop();
        [[fallthrough]];
      case '\x81': {
        Pop();
        Push(objects_.New(*Pop()));
        return true;
      }
      case 'b': {
        PickleNode* state = Pop();
        objects_.SetState(*Top(), *state);
        return true;
      }
      default:
        return false;
    }
  }

  std::string_view bytes_;
  std::string where_;
  Pickle& pickle_;
  PickleObjects objects_;
  std::size_t at_ = 0;
  std::vector<PickleNode*> stack_;
  std::vector<std::size_t> marks_;
  std::unordered_map<std::uint64_t, PickleNode*> memo_;
  PickleNode* none_ = nullptr;
  PickleNode* booleans_[2] = {};
};

}  // namespace

Pickle ParsePickle(std::string_view bytes, const std::string& where, MemoryBudget& budget) {
  Pickle pickle;
  Machine(bytes, where, pickle, budget).Run();
  return pickle;
}

}  // namespace sole::io
