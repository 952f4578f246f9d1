#pragma once

#include <type_traits>

namespace stereotrack {

namespace detail {

template <class Function>
inline constexpr bool kNeverThrows = false;
template <class R, class... In>
inline constexpr bool kNeverThrows<R (*)(In...) noexcept> = true;
template <class R, class C, class... In>
inline constexpr bool kNeverThrows<R (C::*)(In...) noexcept> = true;
template <class R, class C, class... In>
inline constexpr bool kNeverThrows<R (C::*)(In...) const noexcept> = true;

}  // namespace detail

/// What the frame loop demands of a stage, with the functions that it calls each frame:
///     static_assert(RealTimeStage<Sobel, &Sobel::run>);
/// * None of the functions throws. The pipeline is compiled without exceptions, and where one came from elsewhere
///   noexcept ends the program there, instead of a tracker that goes on with half a state.
/// * The stage owns nothing: its memory is the arena's, it has no destructor to run. So no member is a container.
/// * It is a plain type: no virtual function, which a reader would have to look for.
template <class Stage, auto... kFunctions>
concept RealTimeStage =
    sizeof...(kFunctions) > 0 &&
    (detail::kNeverThrows<decltype(kFunctions)> && ...) && std::is_trivially_destructible_v<Stage> &&
    !std::is_polymorphic_v<Stage>;

}  // namespace stereotrack
