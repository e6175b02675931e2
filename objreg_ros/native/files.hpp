// SPDX-License-Identifier: Apache-2.0
// The kernel files, by the names of the Python files that they stand beside.
#pragma once
#include "objreg_ros/bridge/camera/native/registered_depth.hpp"
#include "objreg_ros/bridge/messages/native/rvl.hpp"
#include "objreg_ros/keyframes/native/tracking.hpp"
#include "objreg_ros/keyframes/native/turn.hpp"
#include "objreg_ros/memory/native/nearest_neighbours.hpp"
#include "objreg_ros/memory/native/retrieval.hpp"
#include "objreg_ros/registration/kernels/native/closest_points.hpp"
#include "objreg_ros/registration/kernels/native/least_squares.hpp"
#include "objreg_ros/registration/kernels/native/projection.hpp"
#include "objreg_ros/registration/kernels/native/same_pose.hpp"
#include "objreg_ros/registration/prepare/native/fpfh.hpp"
#include "objreg_ros/registration/propose/native/pose_voting.hpp"
#include "objreg_ros/registration/refine/native/batch_icp.hpp"
#include "objreg_ros/registration/refine/native/photometric_icp.hpp"
#include "objreg_ros/registration/score/native/free_space.hpp"
#include "objreg_ros/registration/score/native/photometric.hpp"
#include "objreg_ros/registration/score/native/total_score.hpp"
#include "objreg_ros/registration/score/native/view_score.hpp"
#include "objreg_ros/registration/shapes/native/shape.hpp"
#include "objreg_ros/registration/shapes/native/silhouette.hpp"
#include "objreg_ros/registration/shapes/native/silhouette_score.hpp"
#include "objreg_ros/registration/shapes/native/upright_icp.hpp"
#include "objreg_ros/registration/shapes/native/upright_search.hpp"
#include "objreg_ros/registration/shapes/native/visual_hull.hpp"
#include "objreg_ros/segmenter/gravity/native/level_surfaces.hpp"
#include "objreg_ros/segmenter/objects/native/extract.hpp"
#include "objreg_ros/segmenter/objects/native/flags.hpp"
#include "objreg_ros/segmenter/objects/native/selection.hpp"
#include "objreg_ros/segmenter/objects/native/unnamed.hpp"
#include "objreg_ros/segmenter/sensor/native/depth_to_colour.hpp"
#include "objreg_ros/segmenter/sensor/native/view.hpp"
#include "objreg_ros/segmenter/surface/native/cells.hpp"
#include "objreg_ros/segmenter/surface/native/components.hpp"
#include "objreg_ros/segmenter/surface/native/holes.hpp"
#include "objreg_ros/segmenter/surface/native/level.hpp"
#include "objreg_ros/segmenter/surface/native/parts.hpp"
#include "objreg_ros/segmenter/surface/native/seams.hpp"
#include "objreg_ros/segmenter/surface/native/support.hpp"
#include "objreg_tools/simulation/rendering/native/raster.hpp"
#include "objreg_tools/simulation/rendering/native/render.hpp"
#include "objreg_tools/simulation/rendering/native/shade.hpp"
#include "objreg_tools/simulation/sensors/native/camera.hpp"
#include "objreg_tools/simulation/sensors/native/noise.hpp"

namespace objreg {
struct File {
  const char *name;
  PyMethodDef *methods;
};
const File FILES[] = {
    {"batch_icp", batch_icp::METHODS},
    {"camera", camera::METHODS},
    {"cells", cells::METHODS},
    {"closest_points", closest_points::METHODS},
    {"components", components::METHODS},
    {"depth_to_colour", depth_to_colour::METHODS},
    {"extract", extract::METHODS},
    {"flags", flags::METHODS},
    {"fpfh", fpfh::METHODS},
    {"free_space", free_space::METHODS},
    {"holes", holes::METHODS},
    {"least_squares", least_squares::METHODS},
    {"level", level::METHODS},
    {"level_surfaces", level_surfaces::METHODS},
    {"nearest_neighbours", nearest_neighbours::METHODS},
    {"noise", noise::METHODS},
    {"parts", parts::METHODS},
    {"photometric", photometric::METHODS},
    {"photometric_icp", photometric_icp::METHODS},
    {"pose_voting", pose_voting::METHODS},
    {"projection", projection::METHODS},
    {"raster", raster::METHODS},
    {"registered_depth", registered_depth::METHODS},
    {"render", render::METHODS},
    {"retrieval", retrieval::METHODS},
    {"rvl", rvl::METHODS},
    {"same_pose", same_pose::METHODS},
    {"seams", seams::METHODS},
    {"selection", selection::METHODS},
    {"shade", shade::METHODS},
    {"shape", shape::METHODS},
    {"silhouette", silhouette::METHODS},
    {"silhouette_score", silhouette_score::METHODS},
    {"support", support::METHODS},
    {"total_score", total_score::METHODS},
    {"tracking", tracking::METHODS},
    {"turn", turn::METHODS},
    {"unnamed", unnamed::METHODS},
    {"upright_icp", upright_icp::METHODS},
    {"upright_search", upright_search::METHODS},
    {"view", view::METHODS},
    {"view_score", view_score::METHODS},
    {"visual_hull", visual_hull::METHODS},
};
}  // namespace objreg
