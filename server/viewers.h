// Who looks at a frame: the eyes' predicted views, and where they look.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "atlas/density.h"
#include "base/view.h"
#include "server/frame.h"

namespace tessera::server {

// The settings' eyes, or the one that its client view is.
std::vector<Eye> eyes_of(const SessionSettings& settings);

// The client view with the field of the eye that shows a radian with the most pixels: what suffices for it
// suffices for all.
View finest_view(const View& client_view, std::span<const Eye> eyes);

atlas::DensityDisplay display_of(const View& finest, std::span<const Eye> eyes);

// `views` of pvs::predict_views(), `heads` the views that a head without eyes would have at the same times.
// `gaze` in the head's axes; none: straight ahead. The eyes meet at something near, of which nobody knows how
// near it is: so besides the rays from them that are parallel, the one from between them counts.
atlas::Viewers viewers_of(std::span<const View> views, std::span<const View> heads,
                          const std::optional<vec3>& gaze);

}  // namespace tessera::server
