#include "io/text_blocks.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

namespace umbel::io {
namespace {

/// Whether the line whose end is text[at] goes on in the next line.
bool continues(std::string_view text, size_t at) {
  while (at > 0 && is_blank(text[at - 1])) --at;
  return at > 0 && text[at - 1] == '\\';
}

/// Characters up to the last line's end that is not before text[from]; 0 if there is none.
size_t whole_lines(std::string_view text, size_t from) {
  for (size_t at = text.size(); at > from; --at)
    if (text[at - 1] == '\n' && !continues(text, at - 1)) return at;
  return 0;
}

}  // namespace

void ByteSource::read(uint64_t offset, std::span<std::byte> out) const {
  if (file_ != nullptr)
    file_->read(offset, out);
  else if (!out.empty())
    std::memcpy(out.data(), bytes_.data() + offset, out.size());
}

TextBlocks::TextBlocks(const ByteSource& source, size_t block_bytes)
    : source_(source), block_bytes_(std::max<size_t>(block_bytes, 1)) {
  constexpr uint64_t kLook = uint64_t{1} << 16;
  std::string head;
  append(head, 0, std::min(source.size(), kLook));
  has_carriage_returns_ = head.find('\n') == std::string::npos;
  if (head.starts_with("\xef\xbb\xbf")) offset_ = 3;  // the mark of UTF-8
}

void TextBlocks::append(std::string& text, uint64_t offset, size_t count) const {
  const size_t before = text.size();
  text.resize(before + count);
  const std::span<char> added(text.data() + before, count);
  source_.read(offset, std::as_writable_bytes(added));
  if (has_carriage_returns_) std::replace(added.begin(), added.end(), '\r', '\n');
}

bool TextBlocks::next(TextBlock& block) {
  std::string& text = block.text;
  text.assign(rest_);
  rest_.clear();
  block.offset = offset_;
  block.size = 0;
  while (block.size == 0) {
    const size_t before = text.size();
    const uint64_t at = offset_ + before;
    if (at == source_.size()) break;
    append(text, at, std::min<uint64_t>(block_bytes_, source_.size() - at));
    block.size = whole_lines(text, before);
  }
  block.is_cut = block.size == 0;  // nothing more comes, and no line ends
  if (block.is_cut && text.empty()) return false;
  if (block.is_cut)
    block.size = text.size() + 1;
  else
    rest_.assign(text, block.size);
  offset_ += text.size() - rest_.size();
  text.resize(text.size() - rest_.size());
  text.append(block.is_cut ? 3 : 2, '\n');
  return true;
}

void TextBlocks::again(uint64_t offset, size_t size, TextBlock& block) const {
  block.offset = offset;
  block.size = size;
  block.text.clear();
  append(block.text, offset, std::min<uint64_t>(size, source_.size() - offset));
  block.text.append(3, '\n');
}

}  // namespace umbel::io
