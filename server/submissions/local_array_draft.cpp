#include "submissions/local_array_draft.h"

#include <utility>

#include "store/array_source.h"
#include "store/submissions.h"
#include "submissions/arrays.h"

namespace marble::server {

LocalArrayDraft::LocalArrayDraft(Arrays& arrays, const Caller& caller,
                                 std::shared_ptr<const ArraySetup> setup,
                                 std::shared_ptr<Scheduler::Place> place, const std::string& setup_bytes)
    : ArrayDraft(arrays.parts_, caller, std::move(setup), setup_bytes, arrays.parts_.config.array_elements),
      arrays_(arrays),
      place_(std::move(place)),
      is_repeated_(place_ == nullptr) {}

// A failed write is reported at the end; until then other writes may succeed.
std::shared_ptr<ArrayDraft> LocalArrayDraft::make(Arrays& arrays, const Caller& caller,
                                                  std::shared_ptr<const ArraySetup> setup,
                                                  std::shared_ptr<Scheduler::Place> place,
                                                  const std::string& setup_bytes) {
  const std::shared_ptr<LocalArrayDraft> draft(
      new LocalArrayDraft(arrays, caller, std::move(setup), std::move(place), setup_bytes));
  if (draft->is_repeated_) return draft;
  arrays.elements_.open_array(draft->stored(setup_bytes), [draft](const Expected<void>& made) {
    if (!made) draft->fail(Submissions::not_kept(made.error()));
  });
  return draft;
}

LocalArrayDraft::~LocalArrayDraft() {
  if (!is_repeated_ && !is_sealed_) arrays_.elements_.forget(id());
}

void LocalArrayDraft::keep(StoredElement element, CompletionCallback settled) {
  arrays_.elements_.add_element(std::move(element), std::move(settled));
}

void LocalArrayDraft::seal_all(const Sealed& sealed) {
  const auto known = parts_.results.expect(id(), caller().identity.client, {request_id(), digest()});
  if (!known) return sealed(unexpected(known.error()));
  if (*known != id()) {
    return arrays_.elements_.when_settled(
        [sealed, response = reported(*known)](const Expected<void>& /*written*/) { sealed(response); });
  }
  if (!is_repeated_) return seal_new(sealed);
  // The other array was dropped meanwhile, and this one was not kept.
  parts_.results.forget(id());
  sealed(unexpected(array_dropped()));
}

// A client that gets the id finds the array.
void LocalArrayDraft::seal_new(const Sealed& sealed) {
  arrays_.elements_.seal_array(
      id(), elements(), digest(), [self = self(), sealed](const Expected<void>& made) {
        const auto why = self->failed();
        if (!made || why) {
          self->parts_.results.forget(self->id());
          return sealed(unexpected(why ? *why : Submissions::not_kept(made.error())));
        }
        self->is_sealed_ = true;
        ArrayStart start{.record = self->setup().record(),
                         .setup = self->shared_setup(),
                         .place = std::exchange(self->place_, nullptr),
                         .counts = {.elements = self->elements()}};
        for (std::int64_t index = 0; index < self->elements(); ++index) start.open.push_back({index, 0});
        self->arrays_.run(std::move(start));
        sealed(self->reported(self->id()));
      });
}

}  // namespace marble::server
