"""Writes small checkpoints in the layout of the released X-Avatar code, and what their networks answer, with real PyTorch.

    pip install torch pytorch-lightning omegaconf safetensors numpy
    python make_official.py

scan.pth        torch.save of three state dicts
scan.ckpt       what PyTorch Lightning saves of the same networks: optimiser states, hyperparameters and buffers beside them
legacy.pth      a few numbers in PyTorch's format before 1.6, which is not a zip archive
meta_info.npz   as beside the released checkpoints
expected.safetensors  inputs and outputs, computed in float64
"""
import math
import warnings

import numpy as np
import pytorch_lightning as pl
import torch
from omegaconf import OmegaConf
from safetensors.torch import save_file

warnings.filterwarnings("ignore")
torch.manual_seed(20220)
BETAS = np.linspace(-1.0, 1.5, 10)
CONDITION, EMBEDDED, FREQUENCIES, BLEND = 73, 16, 4, 20.0
PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
for wrist in (20, 21):
    first = len(PARENTS)
    PARENTS += [wrist if knuckle % 3 == 0 else first + knuckle - 1 for knuckle in range(15)]


class Network(torch.nn.Module):
    """Softplus layers with weight normalisation; the encoded point joins layer `skip`, the condition layer 0."""

    def __init__(self, inputs, outputs, width, depth, frequencies, skip, condition, embedded):
        super().__init__()
        self.frequencies, self.skip, self.depth = frequencies, skip, depth
        encoded = inputs * (1 + 2 * frequencies)
        if embedded:
            self.lin_p0 = torch.nn.Linear(condition, embedded)
        for layer in range(depth + 1):
            columns = encoded + (embedded or condition) if layer == 0 else width
            rows = outputs if layer == depth else width - encoded if layer + 1 == skip else width
            linear = torch.nn.utils.weight_norm(torch.nn.Linear(columns, rows))
            torch.nn.init.normal_(linear.weight_v, 0.0, math.sqrt(2.0 / rows))
            torch.nn.init.normal_(linear.bias, 0.0, 0.05)
            with torch.no_grad():
                # So that g is not merely the length of v.
                linear.weight_g.mul_(torch.empty_like(linear.weight_g).uniform_(0.8, 1.2))
            setattr(self, f"lin{layer}", linear)

    def forward(self, x, condition):
        bands = [x]
        for band in range(self.frequencies):
            bands += [torch.sin(2.0**band * x), torch.cos(2.0**band * x)]
        encoded = torch.cat(bands, -1)
        if hasattr(self, "lin_p0"):
            condition = self.lin_p0(condition)
        x = encoded if condition is None else torch.cat([encoded, condition], -1)
        feature = None
        for layer in range(self.depth + 1):
            if layer == self.skip:
                x = torch.cat([x, encoded], -1) / math.sqrt(2.0)
            if layer == self.depth:
                feature = x
            x = getattr(self, f"lin{layer}")(x)
            if layer < self.depth:
                x = torch.nn.functional.softplus(x, beta=100)
        return x, condition, feature


class Deformer(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.lbs_network = Network(3, 59, 16, 3, 0, None, 0, 0)


class Model(pl.LightningModule):
    def __init__(self, opt):
        super().__init__()
        self.save_hyperparameters()
        self.shape_net = Network(3, 1, 32, 6, FREQUENCIES, 4, CONDITION, EMBEDDED)
        self.color_net = Network(6, 3, 56, 5, FREQUENCIES, 4, EMBEDDED + 32, 0)
        self.deformer = Deformer()
        # The released model keeps its body model's arrays among its own.
        self.smpl_server = torch.nn.Module()
        self.smpl_server.register_buffer("faces_tensor", torch.arange(12).reshape(4, 3))
        with torch.no_grad():
            # About 1 - |x|: inside a sphere, so that there is a surface to extract.
            last = self.shape_net.lin6
            last.weight_v.normal_(-math.sqrt(math.pi) / math.sqrt(32), 1e-2)
            last.weight_g.copy_(last.weight_v.norm())
            last.bias.fill_(1.0)
            self.shape_net.lin0.weight_v[:, 3:] *= 0.05
            self.shape_net.lin4.weight_v[:, -24:] *= 0.05
            for layer in (0, 1, 2, 4, 5):
                linear = getattr(self.shape_net, f"lin{layer}")
                linear.weight_g.copy_(linear.weight_v.norm(dim=1, keepdim=True))
            # Colours that use the whole range.
            self.color_net.lin5.weight_g *= 8.0
            linear = self.shape_net.lin3
            linear.weight_g.copy_(0.9 * linear.weight_v.norm(dim=1, keepdim=True))

    def training_step(self, batch, index):
        return self.color_net.lin5.bias.sum()

    def train_dataloader(self):
        return torch.utils.data.DataLoader(torch.zeros(1, 1))

    def configure_optimizers(self):
        optimiser = torch.optim.Adam([self.color_net.lin5.bias], lr=0.0)
        return [optimiser], [torch.optim.lr_scheduler.StepLR(optimiser, 1)]


def skinning_weights(logits):
    """Mass 1 enters at the root; a joint keeps 1 - sigma(gate) and sends the rest on, siblings share it by softmax."""
    children = [[c for c, p in enumerate(PARENTS) if p == joint] for joint in range(55)]
    branching = [joint for joint in range(1, 55) if len(children[joint]) > 1]
    mass, weights = {0: torch.ones_like(logits[:, 0])}, torch.zeros_like(logits[:, :55])
    for joint in range(55):
        if not children[joint]:
            weights[:, joint] = mass[joint]
            continue
        own = 0 if joint == 0 else 55 + branching.index(joint) if joint in branching else children[joint][0]
        gate = torch.sigmoid(logits[:, own])
        weights[:, joint] = mass[joint] * (1 - gate)
        shares = torch.softmax(logits[:, children[joint]], -1)
        for share, child in zip(shares.T, children[joint]):
            mass[child] = mass[joint] * gate * share
    return weights


opt = OmegaConf.create({"model_type": "smplx", "network": {"width": 32, "skip_layer": [4]}, "soft_blend": 5})
model = Model(opt)
torch.save(
    {
        "shapenet_state_dict": model.shape_net.state_dict(),
        "deformer_state_dict": model.deformer.state_dict(),
        "colornet_state_dict": model.color_net.state_dict(),
    },
    "scan.pth",
)
# A checkpoint callback would note the folder's absolute path.
trainer = pl.Trainer(
    max_epochs=1, accelerator="cpu", logger=False, enable_checkpointing=False, enable_progress_bar=False
)
trainer.fit(model)
trainer.save_checkpoint("scan.ckpt")
torch.save({"numbers": torch.arange(3.0)}, "legacy.pth", _use_new_zipfile_serialization=False)
np.savez(
    "meta_info.npz",
    gender="neutral",
    betas=BETAS,
    use_pca=False,
    num_pca_comps=12,
    flat_hand_mean=False,
    representation="occ",
)

model = model.double()
points = torch.randn(40, 3).double() * 0.6
normals = torch.nn.functional.normalize(torch.randn(40, 3).double(), dim=-1)
condition = torch.randn(CONDITION).double() * 0.3
with torch.no_grad():
    values, embedded, features = model.shape_net(points, condition.expand(40, -1))
    colours, _, _ = model.color_net(torch.cat([points, normals], -1), torch.cat([embedded, features], -1))
    logits, _, _ = model.deformer.lbs_network(points, None)
expected = {
    "points": points,
    "normals": normals,
    "condition": condition,
    "values": values[:, 0],
    "features": features,
    "colours": torch.sigmoid(colours),
    "weights": skinning_weights(BLEND * logits),
}
print({name: (float(tensor.min()), float(tensor.max())) for name, tensor in expected.items()})
save_file({name: tensor.float().contiguous() for name, tensor in expected.items()}, "expected.safetensors")
