#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "io/npz.h"

namespace sole::io {

enum class PickleKind {
  kNone,
  kBool,
  kInt,
  kReal,
  kText,    ///< UTF-8
  kBytes,   ///< bytes, and every string of Python 2
  kList,    ///< list, tuple or set
  kDict,    ///< items: key, value, key, value ...
  kClass,   ///< a class or function that may stand in a pickle; text: its name
  kDtype,   ///< text: byte order and type
  kArray,   ///< array, or items where it holds objects; neither where its dtype is not read
  kObject,  ///< inert object of chumpy or scipy; text: its class, state: its dictionary
};

/// One object of a pickle; may be shared and may contain itself.
struct PickleNode {
  PickleKind kind = PickleKind::kNone;
  std::int64_t integer = 0;
  double real = 0;
  std::string text;
  std::vector<PickleNode*> items;
  std::unique_ptr<NpyArray> array;
  PickleNode* state = nullptr;
};

/// Memory that reading may take besides the file itself: a small multiple of its size.
class MemoryBudget {
 public:
  explicit MemoryBudget(std::size_t file_size) : left_(8 * file_size + (std::size_t{1} << 20)) {}
  /// False if that many bytes are not left.
  bool Take(std::size_t bytes) {
    if (bytes > left_) return false;
    left_ -= bytes;
    return true;
  }

 private:
  std::size_t left_;
};

/// Owner of the objects.
struct Pickle {
  std::deque<PickleNode> nodes;
  const PickleNode* root = nullptr;

  /// Throws Error beyond a million objects.
  PickleNode* Add(PickleKind kind, const std::string& where);
};

/// Stands in for the classes and functions that a pickle names.
class PickleObjects {
 public:
  PickleObjects(Pickle& pickle, MemoryBudget& budget, const std::string& where)
      : pickle_(pickle), budget_(budget), where_(where) {}

  /// A class or function by name; throws Error unless it is one of the few that are known.
  PickleNode* Class(const std::string& name);
  /// What `callable` gives for the arguments (a tuple).
  PickleNode* Call(const PickleNode& callable, const PickleNode& arguments);
  /// A new object of a class, its arguments ignored.
  PickleNode* New(const PickleNode& type);
  /// Gives `object` its state.
  void SetState(PickleNode& object, PickleNode& state);

 private:
  [[noreturn]] void Refuse(const std::string& what) const;
  PickleNode* CallNumpy(const std::string& name, const PickleNode& arguments);
  PickleNode* Encoded(const PickleNode& arguments);
  void FillArray(PickleNode& array, const PickleNode& shape, const PickleNode& dtype, bool fortran,
                 const PickleNode& data);

  Pickle& pickle_;
  MemoryBudget& budget_;
  const std::string& where_;
};

/// Undoes repr() of a Python 2 string, quotes included.
std::string Unquoted(std::string_view text);

/// UTF-8 of "raw-unicode-escape".
std::string Unescaped(std::string_view text);

/// Runs the pickle's stack machine. Throws Error on damage and on what is not allowed.
Pickle ParsePickle(std::string_view bytes, const std::string& where, MemoryBudget& budget);

}  // namespace sole::io
