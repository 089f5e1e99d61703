"""Installs fetch_composer; the extras name what each optional part needs."""

import pathlib

import setuptools

_HERE = pathlib.Path(__file__).parent

GYMNASIUM = ['gymnasium>=1.1']
ONNX = ['onnx>=1.16', 'onnxruntime>=1.17']
EXPLORE = [
    'imageio[ffmpeg]>=2.31',
    'jinja2>=3.1',
    'matplotlib>=3.7',
    'scipy>=1.10',
    'tqdm>=4.60',
    'trimesh>=4',
    'viser>=1.1,<2',
    *ONNX,
]
# Clients: the releases that the examples and tests were seen to work with; see docs/clients.md.
ACME = ['dm-acme==0.2.4']
SB3 = [
    'stable-baselines3>=2.9.2,<2.10',
    'sb3-contrib>=2.9.2,<2.10',
    'matplotlib>=3.7',
    'moviepy>=2',  # For VecVideoRecorder, and for Gymnasium's RecordVideo.
    *GYMNASIUM,
]
SBX = ['sbx-rl>=0.28,<0.29', *SB3]
RL_ZOO = ['rl_zoo3>=2.9.2,<2.10', *SB3]
TORCHRL = ['torchrl==0.14.1', 'tensordict>=0.14,<0.15', *GYMNASIUM]
RAY = ['ray>=2.60,<2.61']
# Pillow and h5py are not among Minari's own requirements, and it has none for Python 3.10.
MINARI = [
    'minari>=0.5.4,<0.6; python_version >= "3.11"',
    'h5py>=3.8',
    'pillow>=10',
    *GYMNASIUM,
]
# Its loader reads what the explorer writes without it; for reading, and its tests.
OGBENCH = ['ogbench>=1.2.2,<1.3']
LEROBOT = ['lerobot>=0.4.4,<0.5']
LEARN = ['jax>=0.4.30', 'optax>=0.2.2', *EXPLORE]
WARP = ['mujoco-warp==3.17.*', 'warp-lang>=1.19']
DOCS = ['furo>=2025.9', 'myst-nb>=1.3', 'sphinx>=8.1', *GYMNASIUM, *LEARN, *WARP]
TEST = ['hypothesis>=6.100', 'pytest>=8', 'pytest-xdist>=3.7', 'ruff>=0.6', 'mypy>=1.10']

setuptools.setup(
    name='fetch_composer',
    version='0.1.0',
    description='The Fetch manipulation tasks as a dm_control Composer suite',
    long_description=(_HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    python_requires='>=3.10',
    packages=setuptools.find_packages(include=['fetch_composer', 'fetch_composer.*']),
    package_data={
        'fetch_composer': [
            'py.typed',
            'entities/*.xml',
            'entities/*.npz',
            'tasks/*.json',
            'explorer/report/*.j2',
            'policies/trained/*.json',
            'policies/trained/*.onnx',
        ]
    },
    install_requires=[
        'absl-py>=2.0',
        'dm-control>=1.0.50,<1.1',  # The native step reads Composer's private structure.
        'dm-env>=1.6',
        'mujoco>=3.17,<4',
        'numpy>=1.26',
    ],
    extras_require={
        'gymnasium': GYMNASIUM,
        'explore': EXPLORE,
        'acme': ACME,
        'learn': LEARN,
        'onnx': ONNX,
        'sb3': SB3,
        'sbx': SBX,
        'zoo': RL_ZOO,
        'torchrl': TORCHRL,
        'ray': RAY + EXPLORE,
        'minari': MINARI + EXPLORE,
        'ogbench': OGBENCH + EXPLORE,
        'lerobot': LEROBOT + EXPLORE,
        'warp': WARP,
        'docs': DOCS,
        'test': TEST + GYMNASIUM + EXPLORE + LEARN,
    },
)
