#include "engine/select/minimum_cut.h"

#include <boost/graph/boykov_kolmogorov_max_flow.hpp>
#include <boost/graph/compressed_sparse_row_graph.hpp>
#include <boost/property_map/property_map.hpp>
#include <cassert>
#include <cstddef>
#include <utility>

namespace engine::select {
namespace {

using Graph = boost::compressed_sparse_row_graph<boost::directedS, boost::no_property, boost::no_property,
                                                 boost::no_property, std::uint32_t, std::uint32_t>;
using Edge = boost::graph_traits<Graph>::edge_descriptor;

constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

bool is_certain(std::int32_t pull) { return pull == certainly_inside || pull == certainly_outside; }

/// A flow network of the nodes that are not certain: what is certain is one with the source or with the sink, so that
/// an edge to it is a pull. Edges stand in the order of the node they leave.
struct Network {
  std::vector<std::uint32_t> number;  ///< [nodes] in the network; none for a certain one.
  std::uint32_t source = 0, sink = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ends;
  std::vector<std::int64_t> capacity;
  std::vector<Edge> back;

  void add(std::uint32_t from, std::uint32_t to, std::int64_t room) {
    ends.emplace_back(from, to);
    capacity.push_back(room);
    back.emplace_back();
  }
  void pair_up(std::uint32_t a, std::uint32_t b) {
    back[a] = Edge(ends[b].first, b);
    back[b] = Edge(ends[a].first, a);
  }
};

Network network_of(const NeighbourGraph& graph, std::span<const std::int32_t> capacity,
                   std::span<const std::int32_t> pull) {
  Network net;
  net.number.assign(graph.size(), none);
  std::uint32_t count = 0;
  for (std::size_t node = 0; node < graph.size(); ++node)
    if (!is_certain(pull[node])) net.number[node] = count++;
  net.source = count, net.sink = count + 1;
  std::vector<std::uint32_t> place(graph.to.size(), none);  // of edges between nodes of the network
  std::vector<std::uint32_t> link(count, none);             // of edges between them and source or sink
  std::vector<std::int64_t> pulled(count, 0);
  for (std::size_t node = 0; node < graph.size(); ++node) {
    const std::uint32_t from = net.number[node];
    if (from == none) continue;
    std::int64_t all = pull[node];
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const std::uint32_t to = net.number[graph.to[edge]];
      if (to == none) {
        all += pull[graph.to[edge]] > 0 ? capacity[edge] : -capacity[edge];
        continue;
      }
      if (capacity[edge] == 0) continue;
      place[edge] = std::uint32_t(net.ends.size());
      net.add(from, to, capacity[edge]);
      if (const std::uint32_t other = place[graph.back[edge]]; other != none) net.pair_up(place[edge], other);
    }
    pulled[from] = all;
    link[from] = std::uint32_t(net.ends.size());
    if (all > 0) net.add(from, net.source, 0);
    if (all < 0) net.add(from, net.sink, -all);
  }
  for (const std::uint32_t end : {net.source, net.sink})
    for (std::uint32_t node = 0; node < count; ++node) {
      if (end == net.source ? pulled[node] <= 0 : pulled[node] >= 0) continue;
      net.add(end, node, end == net.source ? pulled[node] : 0);
      net.pair_up(link[node], std::uint32_t(net.ends.size() - 1));
    }
  return net;
}

}  // namespace

std::vector<std::uint8_t> minimum_cut(const NeighbourGraph& graph, std::span<const std::int32_t> capacity,
                                      std::span<const std::int32_t> pull) {
  assert(capacity.size() == graph.to.size() && pull.size() == graph.size());
  const Network net = network_of(graph, capacity, pull);
  const std::uint32_t nodes = net.sink + 1;
  Graph flow(boost::edges_are_sorted, net.ends.begin(), net.ends.end(), nodes);
  const auto edge_number = get(boost::edge_index, flow);
  std::vector<std::int64_t> residual(net.ends.size());
  std::vector<boost::default_color_type> side(nodes);
  boost::boykov_kolmogorov_max_flow(flow, boost::make_iterator_property_map(net.capacity.begin(), edge_number),
                                    boost::make_iterator_property_map(residual.begin(), edge_number),
                                    boost::make_iterator_property_map(net.back.begin(), edge_number),
                                    boost::make_iterator_property_map(side.begin(), get(boost::vertex_index, flow)),
                                    get(boost::vertex_index, flow), net.source, net.sink);
  std::vector<std::uint8_t> inside(graph.size());
  for (std::size_t node = 0; node < graph.size(); ++node)
    inside[node] = net.number[node] == none ? pull[node] > 0 : side[net.number[node]] == boost::black_color;
  return inside;
}

}  // namespace engine::select
